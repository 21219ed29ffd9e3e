// The drawing of a rig, its body turned by the measured angle: the first part of the drawing that is turned about a place.
export default {
  template: '<div class="swingid-view" role="img" aria-label="the rig, as it moves" v-html="picture"></div>',
  props: { picture: String },
  mounted() {
    const part = this.$el.querySelector("g[transform]");
    const found = part?.getAttribute("transform").match(/translate\(([-\d.]+) ([-\d.]+)\) rotate\(([-\d.]+)\)/);
    this.at = found && { part, x: found[1], y: found[2] };
  },
  methods: {
    turn(angle) {
      if (!this.at) return;
      const { part, x, y } = this.at;
      part.setAttribute("transform", `translate(${x} ${y}) rotate(${((-180 / Math.PI) * angle).toFixed(2)})`);
    },
  },
};
