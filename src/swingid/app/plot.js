// A uPlot in a Vue component: each channel has a time of its own until it is drawn, so that thinned channels line up.
import { loadResource } from "../../static/utils/resources.js";

const DASHES = [[], [8, 3], [2, 3], [10, 3, 2, 3], [5, 2], [1, 2]];
const FEW = 8; // rows of a line that are drawn as dots, too
const KEPT = 60000; // rows of a live plot, a minute at 1 kHz

function unpacked(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (letter) => letter.charCodeAt(0));
  const numbers = new Float32Array(bytes.buffer);
  const time = Array.from(numbers.subarray(0, packed.rows), (t) => t + packed.first);
  const values = Array.from(numbers.subarray(packed.rows), (v) => (Number.isNaN(v) ? null : v + packed.middle));
  return [time, values];
}

// Round levels from low to high, about `wanted` of them and three at least, where the range is not empty.
function levels(low, high, wanted) {
  const wide = high - low;
  if (!(wide > 0)) return [low];
  let found = [];
  for (let power = Math.floor(Math.log10(wide)); ; power--) {
    for (const first of [5, 2.5, 2, 1]) {
      const step = first * 10 ** power;
      const next = [];
      for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * wide; k++) next.push(k * step);
      if (found.length >= 3 && next.length > wanted) return found;
      found = next;
    }
  }
}

export default {
  template: `
    <div class="swingid-plot" role="img" :aria-label="title">
      <div class="swingid-plot-title">{{ title }}</div>
      <div class="swingid-plot-unit">
        <span>{{ unit }}</span>
        <span v-for="one in key" :key="one.label" class="swingid-plot-key">
          <svg width="24" height="8" aria-hidden="true"><line x1="0" y1="4" x2="24" y2="4" :stroke="one.ink" :stroke-dasharray="one.dash" stroke-width="2" /></svg>{{ one.label }}
        </span>
        <span class="swingid-plot-read">{{ read }}</span>
      </div>
      <div ref="place"></div>
    </div>`,
  props: { title: String, lines: Array, limits: Array, window: Number, height: Number, pickable: Boolean, shown: Array, parts: Array, band: Array },
  data() {
    return { power: 0, read: "", key: [] };
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
    unit() {
      const factor = this.power ? `10${String(this.power).replace("-", "⁻").replace(/\d/g, (d) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d])} ` : "";
      return `${factor}${this.lines[0].unit}`;
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
    this.follow = (event) => this.pickable && this.plot?.setCursor({ left: this.plot.valToPos(event.detail, "x"), top: -10 }, false);
    window.addEventListener("swingid-played", this.follow);
    if (this.shown) this.show(...this.shown);
    (this.waiting || []).forEach(([name, args]) => this[name](...args));
    this.waiting = null;
  },
  beforeUnmount() {
    this.sizes?.disconnect();
    this.dark?.disconnect();
    window.removeEventListener("swingid-played", this.follow);
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
      this.inks = this.lines.map((line) => (dark && bright[line.colour]) || line.colour);
      const many = this.lines.length > 1;
      this.key = many && this.window ? this.lines.map((line, k) => ({ label: line.label, ink: this.inks[k], dash: DASHES[k].join(" ") })) : [];
      const right = many && !this.window ? 12 + 6.6 * Math.max(...this.lines.map((line) => line.label.length)) : 16;
      const series = this.lines.map((line, k) => ({
        label: line.label,
        stroke: this.inks[k],
        dash: line.points ? undefined : DASHES[k % DASHES.length],
        width: line.points ? 0 : 1.4,
        points: { show: line.points || ((plot) => plot.data[0].length < FEW), size: k % 2 ? 6 : 5, width: k % 2 ? 1.5 : 0, fill: k % 2 ? this.ink("ground") : this.inks[k] },
        paths: line.points ? () => null : undefined,
        spanGaps: false,
      }));
      this.plot = new uPlot(
        {
          width: Math.max(this.$refs.place.clientWidth, 200),
          height: this.height,
          legend: { show: false },
          padding: [8, right, 0, 0],
          cursor: { drag: { x: true, y: false, setScale: !this.pickable } },
          select: { show: true },
          scales: { x: { time: false, range: (_, low, high) => (low == null ? [0, this.window || 10] : [low, high]) }, y: { range: (_, low, high) => this.range(low, high) } },
          axes: [
            { ...axis, size: 34, splits: (plot, _, low, high) => levels(low, high, Math.max(3, plot.bbox.width / devicePixelRatio / 72)), values: (_, ticks) => this.ticks(ticks, 0).map((t, k) => (k === ticks.length - 1 ? `${t} s` : t)) },
            { ...axis, splits: (plot, _, low, high) => levels(low, high, Math.max(3, this.height / 36)), size: (_, values) => Math.max(56, 24 + 7.5 * Math.max(0, ...(values || []).map((v) => v.length))), values: (_, ticks) => this.values(ticks) },
          ],
          series: [{}, ...series],
          hooks: { draw: [(plot) => this.drawn(plot)], setSelect: [(plot) => this.picked(plot)], setCursor: [(plot) => this.pointed(plot)] },
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
      if (!this.window) this.label(plot);
      if (this.parts?.length) {
        draw.fillStyle = this.was ? "rgba(0,0,0,0.6)" : "rgba(118,118,118,0.3)";
        const edges = this.parts.flat().map((t) => inside(plot.valToPos(t, "x", true), left, left + width));
        const from = [left, ...edges.filter((_, k) => k % 2)];
        const to = [...edges.filter((_, k) => k % 2 === 0), left + width];
        from.forEach((x, k) => to[k] > x && draw.fillRect(x, top, to[k] - x, height));
      }
      draw.restore();
    },
    label(plot) {
      // the name of each of several channels, beside its last value
      if (this.lines.length < 2) return;
      const { left, top, width, height } = plot.bbox;
      const draw = plot.ctx;
      const high = 14 * devicePixelRatio;
      const placed = this.channels
        .map(([, values], k) => ({ k, last: values.findLast((v) => v != null) }))
        .filter(({ last }) => last != null)
        .map(({ k, last }) => ({ k, y: Math.min(Math.max(plot.valToPos(last, "y", true), top), top + height - high) }))
        .sort((a, b) => a.y - b.y);
      placed.forEach((one, k) => k && (one.y = Math.max(one.y, placed[k - 1].y + high)));
      draw.font = `${12 * devicePixelRatio}px system-ui, sans-serif`;
      draw.textBaseline = "middle";
      draw.textAlign = "left";
      for (const { k, y } of placed) {
        draw.fillStyle = this.inks[k];
        draw.fillText(this.lines[k].label, left + width + 6 * devicePixelRatio, y);
      }
    },
    pointed(plot) {
      const t = plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : NaN;
      const near = this.channels.map(([times, values]) => {
        if (!times.length || !(t >= times[0] && t <= times[times.length - 1])) return null;
        let [low, high] = [0, times.length - 1];
        while (high - low > 1) [low, high] = times[(low + high) >> 1] > t ? [low, (low + high) >> 1] : [(low + high) >> 1, high];
        return values[t - times[low] < times[high] - t ? low : high];
      });
      const said = this.lines.map(({ label, unit }, k) => (near[k] == null ? "" : `${label} ${near[k].toPrecision(4)} ${unit}`.trim()));
      this.read = said.some(Boolean) ? [`${t.toFixed(3)} s`, ...said.filter(Boolean)].join(" · ") : "";
      if (this.pickable && this.read && plot.cursor.event) window.dispatchEvent(new CustomEvent("swingid-pointed", { detail: t }));
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
