// The bar with the state and STOP. It believes only what it hears: without a sign of the server it says so and greys STOP.
const SILENT = 2000; // ms without anything from the server, which sends a beat every 500 ms
const SLOW = 1000; // ms within which the server answers to STOP
const LOST = "not connected: use the emergency stop";

export default {
  template: `
    <div class="swingid-bar" :class="kind">
      <div v-if="share > 0 && !lost" class="swingid-bar-share" :style="{ width: 100 * share + '%' }" role="progressbar" aria-label="progress" :aria-valuenow="Math.round(100 * share)"></div>
      <div class="swingid-bar-words" role="status" aria-live="polite">{{ said }}</div>
      <button type="button" class="swingid-stop" style="opacity: 1 !important" :disabled="lost" aria-keyshortcuts="Escape" @click="press">STOP (Esc)</button>
    </div>`,
  props: { words: String, moves: Boolean, share: Number, beat: Number, heard: Number },
  data() {
    return { lost: true, met: false, pressed: 0, since: 0, slow: false };
  },
  computed: {
    waits() {
      return this.pressed > this.heard;
    },
    kind() {
      if (!this.met) return "";
      if (this.lost || (this.waits && this.slow)) return "swingid-bar-lost";
      return this.moves ? "swingid-bar-moves" : "";
    },
    said() {
      if (!this.met) return "connecting to the server …";
      if (this.lost) return LOST;
      if (this.waits) return this.slow ? "STOP has not arrived: use the emergency stop" : "sending STOP …";
      return this.words;
    },
  },
  watch: {
    beat(now) {
      window.swingidBeat = now;
    },
  },
  mounted() {
    window.swingidBeat = this.beat;
    this.pressed = this.heard;
    this.last = this.opened = performance.now();
    this.hear = () => {
      this.last = performance.now();
      this.look();
    };
    this.look = () => {
      const now = performance.now();
      this.lost = !window.socket?.connected || now - this.last > SILENT;
      this.met ||= !this.lost || now - this.opened > 2 * SILENT;
      this.slow = now - this.since > SLOW;
      // no other button works either: what was pressed meanwhile would act later, unexpected
      for (const part of document.querySelectorAll(".q-page-container")) part.inert = this.lost;
      document.body.classList.toggle("swingid-lost", this.lost);
    };
    this.onKey = (event) => {
      if (event.key === "Escape" && !event.repeat) this.press();
    };
    window.addEventListener("keydown", this.onKey, true);
    this.timer = setInterval(() => {
      this.listen();
      this.look();
    }, 200);
    this.listen();
    this.look();
  },
  beforeUnmount() {
    clearInterval(this.timer);
    window.removeEventListener("keydown", this.onKey, true);
    this.socket?.offAny(this.hear);
  },
  methods: {
    listen() {
      if (this.socket || !window.socket) return;
      this.socket = window.socket;
      this.socket.onAny(this.hear);
      this.socket.on("connect", this.hear);
      this.socket.on("disconnect", this.look);
    },
    press() {
      this.pressed = Math.max(this.pressed, this.heard) + 1;
      this.since = performance.now();
      this.slow = false;
      this.$emit("stop", this.pressed);
    },
  },
};
