// The drawing of a rig that moves as the measured angles do; with a `track` it plays that back.
const DEGREES = -180 / Math.PI; // a positive angle is counter-clockwise, and SVG's is not
const REACH = 42; // how far a carriage is drawn from its middle at most

export default {
  template: `
    <div class="swingid-view" :class="{ moving }">
      <div role="img" aria-label="the rig, as it moves" ref="place" v-html="picture"></div>
      <div v-if="track" class="swingid-play">
        <button type="button" class="swingid-way" @click="toggle">{{ playing ? "❚❚ Pause" : "▶ Play" }}</button>
        <span class="swingid-quiet swingid-numbers">{{ at.toFixed(1) }} s</span>
      </div>
    </div>`,
  props: { picture: String, moves: String, track: Object },
  data() {
    return { playing: false, at: this.track?.first || 0, moving: false };
  },
  watch: {
    track(now, before) {
      this.playing = false;
      cancelAnimationFrame(this.frame);
      if (!now || now.first === before?.first && now.angles.length === before?.angles.length) return;
      this.at = now.first;
      this.toggle();
    },
  },
  mounted() {
    this.find();
    this.pointed = (event) => this.track && !this.playing && this.show(event.detail);
    window.addEventListener("swingid-pointed", this.pointed);
    if (this.track) this.show(this.track.first);
  },
  beforeUnmount() {
    window.removeEventListener("swingid-pointed", this.pointed);
    cancelAnimationFrame(this.frame);
  },
  methods: {
    find() {
      const svg = this.$refs.place.querySelector("svg svg");
      const group = svg?.querySelector("g[transform]");
      const place = group?.getAttribute("transform").match(/translate\(([-\d.]+) ([-\d.]+)\)/);
      this.swings = place && { group, x: place[1], y: place[2], spoke: group.querySelector("line.arrow"), hub: group.querySelector("circle.drive") };
      if (this.moves === "slide") this.slides = svg && [...svg.querySelectorAll("rect.body, circle.ink, text.b:last-of-type")];
      if (this.moves === "turn" && svg) this.turns = this.mark(svg);
    },
    mark(svg) {
      // a dot on the rim of the body that is in view, for a round body shows no turning
      const [left, , wide] = svg.getAttribute("viewBox").split(" ").map(Number);
      const round = [...svg.querySelectorAll("ellipse.body, circle.body")].find((one) => +one.getAttribute("cx") > left && +one.getAttribute("cx") < left + wide);
      if (!round) return null;
      const [x, y] = ["cx", "cy"].map((name) => +round.getAttribute(name));
      const [across, along] = ["rx", "ry"].map((name) => +(round.getAttribute(name) || round.getAttribute("r")));
      const dot = round.ownerDocument.createElementNS("http://www.w3.org/2000/svg", "circle");
      dot.setAttribute("class", "swingid-rim");
      dot.setAttribute("r", "5");
      svg.append(dot);
      return { dot, x, y, across, along };
    },
    turn(angle, wheel, scale) {
      if (!Number.isFinite(angle)) return;
      this.moving = true;
      if (this.slides) {
        const way = REACH * Math.max(-1, Math.min(1, angle / (scale || 1)));
        for (const part of this.slides) part.setAttribute("transform", `translate(${way.toFixed(2)} 0)`);
      } else if (this.turns) {
        const { dot, x, y, across, along } = this.turns;
        dot.setAttribute("cx", (x + across * Math.sin(angle)).toFixed(2));
        dot.setAttribute("cy", (y + along * Math.cos(angle)).toFixed(2));
      } else if (this.swings) {
        const { group, x, y, spoke, hub } = this.swings;
        group.setAttribute("transform", `translate(${x} ${y}) rotate(${(DEGREES * angle).toFixed(2)})`);
        if (spoke && hub && Number.isFinite(wheel)) {
          spoke.setAttribute("transform", `rotate(${((DEGREES * wheel) % 360).toFixed(2)} ${hub.getAttribute("cx")} ${hub.getAttribute("cy")})`);
        }
      }
    },
    show(t) {
      const { first, step, angles, wheel, scale } = this.track;
      const k = Math.min(Math.max((t - first) / step, 0), angles.length - 1);
      const low = Math.min(Math.floor(k), angles.length - 2);
      const between = (values) => values && values[low] + (k - low) * (values[low + 1] - values[low]);
      this.at = first + k * step;
      this.turn(between(angles), between(wheel), scale);
      return k < angles.length - 1;
    },
    toggle() {
      this.playing = !this.playing;
      cancelAnimationFrame(this.frame);
      if (!this.playing) return;
      const { first, step, angles } = this.track;
      if (this.at >= first + (angles.length - 1) * step - 1e-9) this.at = first;
      let before = performance.now();
      const next = (now) => {
        this.playing = this.show(this.at + (now - before) / 1000);
        before = now;
        window.dispatchEvent(new CustomEvent("swingid-played", { detail: this.at }));
        if (this.playing) this.frame = requestAnimationFrame(next);
      };
      this.frame = requestAnimationFrame(next);
    },
  },
};
