// A uPlot in a Vue component: each channel has a time of its own until it is drawn, so that thinned channels line up.
import { loadResource } from "../../static/utils/resources.js";

const DASHES = [[], [8, 3], [2, 3], [10, 3, 2, 3], [5, 2], [1, 2]];
const KEPT = 60000; // rows of a live plot, a minute at 1 kHz

function unpacked(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (letter) => letter.charCodeAt(0));
  const numbers = new Float32Array(bytes.buffer);
  const time = Array.from(numbers.subarray(0, packed.rows), (t) => t + packed.first);
  const values = Array.from(numbers.subarray(packed.rows), (v) => (Number.isNaN(v) ? null : v + packed.middle));
  return [time, values];
}

export default {
  template: '<div class="swingid-plot" role="img" :aria-label="title"><div class="swingid-plot-title">{{ heading }}</div><div ref="place"></div></div>',
  props: { title: String, lines: Array, limits: Array, window: Number, height: Number, pickable: Boolean, shown: Array, parts: Array, band: Array },
  data() {
    return { power: 0 };
  },
  watch: {
    shown(packed) {
      this.show(...packed);
    },
    parts() {
      this.plot?.redraw();
    },
  },
  computed: {
    heading() {
      const unit = this.lines[0].unit;
      const factor = this.power ? `10${String(this.power).replace("-", "⁻").replace(/\d/g, (d) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d])} ` : "";
      return unit || factor ? `${this.title}, in ${factor}${unit}`.trim() : this.title;
    },
  },
  async mounted() {
    await this.$nextTick();
    const prefix = window.path_prefix || "";
    await loadResource(`${prefix}/swingid/vendor/uPlot.min.css`);
    await loadResource(`${prefix}/swingid/vendor/uPlot.iife.min.js`);
    this.channels = this.lines.map(() => [[], []]);
    this.make();
    this.sizes = new ResizeObserver(() => this.resize());
    this.sizes.observe(this.$refs.place);
    this.dark = new MutationObserver(() => this.make());
    this.dark.observe(document.body, { attributes: true, attributeFilter: ["class"] });
    if (this.shown) this.show(...this.shown);
    (this.waiting || []).forEach(([name, args]) => this[name](...args));
    this.waiting = null;
  },
  beforeUnmount() {
    this.sizes?.disconnect();
    this.dark?.disconnect();
    this.plot?.destroy();
  },
  methods: {
    later(name, args) {
      if (this.plot) return false;
      (this.waiting ||= []).push([name, args]);
      return true;
    },
    make() {
      const dark = document.body.classList.contains("body--dark");
      if (this.plot && dark === this.was) return;
      this.was = dark;
      this.plot?.destroy();
      const look = getComputedStyle(document.body);
      this.ink = (name) => look.getPropertyValue(`--${name}`).trim();
      const grid = { stroke: this.ink("line"), width: 1 };
      const axis = { stroke: this.ink("quiet"), grid, ticks: grid, font: "12px system-ui, sans-serif" };
      const bright = { "#0072B2": "#56B4E9", "#56B4E9": "#9ad4f5" };
      const series = this.lines.map((line, k) => ({
        label: line.unit ? `${line.label}, ${line.unit}` : line.label,
        stroke: dark ? bright[line.colour] || line.colour : line.colour,
        dash: line.points ? undefined : DASHES[k % DASHES.length],
        width: line.points ? 0 : 1.4,
        points: { show: line.points, size: k % 2 ? 6 : 5, width: k % 2 ? 1.5 : 0, fill: k % 2 ? this.ink("ground") : dark ? bright[line.colour] || line.colour : line.colour },
        paths: line.points ? () => null : undefined,
        spanGaps: false,
        value: (_, v) => (v == null ? "–" : v.toPrecision(4)),
      }));
      this.plot = new uPlot(
        {
          width: Math.max(this.$refs.place.clientWidth, 200),
          height: this.height,
          legend: { show: true, live: true },
          cursor: { drag: { x: true, y: false, setScale: !this.pickable } },
          select: { show: true },
          scales: { x: { time: false }, y: { range: (_, low, high) => this.range(low, high) } },
          axes: [
            { ...axis, size: 34, space: 56, values: (_, ticks) => this.ticks(ticks, 0).map((t, k) => (k === ticks.length - 1 ? `${t} s` : t)) },
            { ...axis, space: Math.min(32, this.height / 6), size: (_, values) => Math.max(56, 24 + 7.5 * Math.max(0, ...(values || []).map((v) => v.length))), values: (_, ticks) => this.values(ticks) },
          ],
          series: [{ label: "time, s", value: (_, v) => (v == null ? "–" : v.toFixed(3)) }, ...series],
          hooks: { draw: [(plot) => this.drawn(plot)], setSelect: [(plot) => this.picked(plot)] },
        },
        this.aligned(),
        this.$refs.place
      );
    },
    values(ticks) {
      // one power of ten for all ticks, which the heading states: no digit of a tick is lost
      const large = Math.max(...ticks.map(Math.abs));
      this.power = large && (large < 1e-2 || large >= 1e5) ? 3 * Math.floor(Math.log10(large) / 3) : 0;
      return this.ticks(ticks, this.power);
    },
    ticks(ticks, power) {
      const step = ticks.length > 1 ? Math.abs(ticks[1] - ticks[0]) * 10 ** -power : 1;
      let digits = Math.min(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), 12);
      if (Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6) digits += 1; // steps of 2.5
      return ticks.map((v) => (v * 10 ** -power).toFixed(digits));
    },
    range(low, high) {
      const levels = [...(this.limits || []), ...(this.band || [])];
      const all = [low, high, ...levels].filter((v) => v != null && Number.isFinite(v));
      if (!all.length) return [-1, 1];
      const [from, to] = [Math.min(...all), Math.max(...all)];
      const room = (to - from || Math.abs(to) || 1) * 0.06;
      return [from - room, to + room];
    },
    aligned() {
      if (this.channels.every(([time]) => time.length === 0)) return [[], ...this.channels.map(() => [])];
      if (this.channels.length === 1) return [this.channels[0][0], this.channels[0][1]];
      const [first] = this.channels;
      const same = this.channels.every(([t]) => t.length === first[0].length && t[0] === first[0][0] && t[t.length - 1] === first[0][first[0].length - 1]);
      if (same && this.live) return [first[0], ...this.channels.map(([, v]) => v)];
      return uPlot.join(this.channels.map(([t, v]) => [t, v]), this.channels.map(() => [1]));
    },
    resize() {
      const width = this.$refs.place?.clientWidth;
      if (width && this.plot && Math.abs(width - this.plot.width) > 1) this.plot.setSize({ width, height: this.height });
    },
    show(...packed) {
      if (this.later("show", packed)) return;
      this.live = false;
      this.channels = packed.map(unpacked);
      this.plot.setData(this.aligned());
    },
    append(...packed) {
      if (this.later("append", packed)) return;
      this.live = true;
      packed.map(unpacked).forEach(([time, values], k) => {
        const [t, v] = this.channels[k];
        t.push(...time);
        v.push(...values);
        const last = t[t.length - 1];
        let out = Math.max(0, t.length - KEPT);
        if (this.window) while (out < t.length && t[out] < last - this.window) out++;
        if (out) {
          t.splice(0, out);
          v.splice(0, out);
        }
      });
      if (!document.hidden) this.plot.setData(this.aligned());
    },
    clear() {
      if (this.later("clear", [])) return;
      this.channels = this.lines.map(() => [[], []]);
      this.plot.setData(this.aligned());
    },
    drawn(plot) {
      const { left, top, width, height } = plot.bbox;
      const draw = plot.ctx;
      draw.save();
      const inside = (v, low, high) => Math.min(Math.max(v, low), high);
      const at = (level) => inside(plot.valToPos(level, "y", true), top, top + height);
      if (this.band) {
        const [low, middle, high] = this.band.map(at);
        draw.fillStyle = this.ink("green");
        draw.globalAlpha = 0.22;
        draw.fillRect(left, high, width, low - high);
        draw.globalAlpha = 1;
        draw.fillRect(left, middle - 1, width, 2);
      }
      draw.strokeStyle = this.ink("quiet");
      draw.setLineDash([6, 4]);
      for (const level of this.limits || []) {
        const y = plot.valToPos(level, "y", true);
        if (y < top || y > top + height) continue;
        draw.beginPath();
        draw.moveTo(left, y);
        draw.lineTo(left + width, y);
        draw.stroke();
      }
      if (this.parts?.length) {
        draw.fillStyle = this.was ? "rgba(0,0,0,0.6)" : "rgba(118,118,118,0.3)";
        const edges = this.parts.flat().map((t) => inside(plot.valToPos(t, "x", true), left, left + width));
        const from = [left, ...edges.filter((_, k) => k % 2)];
        const to = [...edges.filter((_, k) => k % 2 === 0), left + width];
        from.forEach((x, k) => to[k] > x && draw.fillRect(x, top, to[k] - x, height));
      }
      draw.restore();
    },
    picked(plot) {
      if (!this.pickable || plot.select.width < 4) return;
      const from = plot.posToVal(plot.select.left, "x");
      const to = plot.posToVal(plot.select.left + plot.select.width, "x");
      plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
      this.$emit("pick", { from, to });
    },
  },
};
