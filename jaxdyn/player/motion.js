// The motion of a scene from the functions that `jaxdyn.player.model` wrote, with `dop853.js`:
// through phases, each of which is smooth and ends at one of its exits. It runs on a page and in Node.
"use strict";

var JaxdynMotion = (() => {
  const LOOKS = 8; // times within a step at which exits are evaluated
  const HALVINGS = 60; // of the part of a step that contains an exit
  const ROUNDINGS = 256 * 2 ** -52; // a value below this relative rounding of its inputs is zero
  const ON = 1e-10; // of a state's largest entry: projection moves a state on a constraint less
  const AT_ONCE = 1e-9, MOST_AT_ONCE = 60; // part of the span, and number of exits, in succession

  // The scene of a model with the switches whose binary digits are 1: those of effects come first.
  const variant = (model, on) => model.variants[on % model.variants.length];

  class Motion {
    // From y at t, with the parameters p and the switches that are on. `passed` is called after each
    // step with its first and last time; at(t) returns its states.
    constructor(model, p, on, t, y, { rtol, span = model.data.span, passed = null } = {}) {
      Object.assign(this, { model, p, on, rtol, span, passed });
      this.crawled = null;
      this.failed = "";
      this.hurried = 0; // exits in succession
      // An exit that is switched off is not a bound either: the phase continues beyond it.
      const corners = Math.floor(on / model.variants.length), stays = (exit) => exit.switch < 0 || (corners >> exit.switch) & 1;
      const phases = this.phases = variant(model, on).phases.map((phase) => ({ ...phase, exits: phase.exits.filter(stays) }));
      const first = phases.length > 1 ? this.following(phases.map((_, i) => i), -1, t, y) : 0;
      this.enter(t, y, Math.max(first, 0));
    }

    get phase() { return this.phases[this.index]; }

    // The time that is reached, and whether it has crawled.
    get t() { return this.ended ? Infinity : this.pending ? this.pending.t : this.solver.t; }

    // Begin a phase; -1 is the end, where the state no longer changes.
    enter(t, y, index) {
      const { p, span, rtol } = this, { data } = this.model;
      this.pending = null;
      if (index < 0) { this.ended = { t, y }; return; }
      this.index = index;
      const phase = this.phase, sizes = this.solver?.sizes;
      this.solver = new Dop853((at, z) => phase.rate(at, z, p), t, y, {
        span, rtol, groups: data.groups, rough: data.rough,
        outcomes: phase.outcomes ? (at) => phase.outcomes(at, y, p) : null,
        project: phase.projects ? (at, z) => phase.consistent(at, z, p) : null,
      });
      if (sizes) this.solver.sizes = this.solver.sizes.map((x, g) => Math.max(x, sizes[g])); // of all phases
      if (!phase.exits.length) return;
      const beyond = this.beyond(phase, t, y).indexOf(true);
      if (beyond >= 0) { this.pending = { t, y, exit: beyond }; return; }
      // An exit is armed once its value is not zero, and on the near side if it has one.
      this.armed = phase.exits.map(() => 0);
      this.arm(t, y);
    }

    arm(t, y) {
      this.phase.exits.forEach((exit, i) => {
        if (this.armed[i]) return;
        const value = exit.value(t, y, this.p)[0], far = exit.direction * value > 0;
        if (!far && Math.abs(value) > this.noise(this.phase, exit.value, t, y)) this.armed[i] = Math.sign(value);
      });
    }

    // The change of a value of a state by the roundings of its inputs.
    noise(phase, f, t, y) {
      const rate = phase.rate(t, y, this.p), here = f(t, y, this.p)[0];
      let sum = 0;
      y.forEach((x, i) => {
        const size = Math.abs(x) + Math.abs(t * rate[i]), h = 1e-6 * size;
        if (size) sum += (Math.abs(f(t, y.map((z, j) => (j === i ? z + h : z)), this.p)[0] - here) / h) * size;
      });
      return ROUNDINGS * (sum + Math.abs(here));
    }

    // Whether a state is beyond the bound of each exit, or leaves there.
    beyond(phase, t, y) {
      return phase.exits.map((exit) => {
        if (!exit.side) return false;
        const value = exit.side * exit.value(t, y, this.p)[0], noise = this.noise(phase, exit.value, t, y);
        if (value < -noise) return true;
        return value <= noise && exit.side * exit.slope(t, y, this.p)[0] < -this.noise(phase, exit.slope, t, y);
      });
    }

    // The first of some phases that a state fits, preferably not the current one; otherwise the first
    // whose constraints it satisfies. The end always fits.
    following(candidates, left, t, y) {
      const ranks = candidates.map((index) => {
        if (index < 0) return 7;
        const phase = this.phases[index], size = Math.max(...y.map(Math.abs));
        const on = !phase.consistent || phase.consistent(t, y, this.p).every((x, i) => Math.abs(x - y[i]) <= ON * size);
        const within = on && !this.beyond(phase, t, y).includes(true);
        return 4 * (within && index !== left) + 2 * within + on;
      });
      const best = ranks.indexOf(Math.max(...ranks));
      return ranks[best] ? candidates[best] : candidates[0];
    }

    // The first exit of the last step, if any.
    look() {
      const { solver, phase } = this, a = solver.before, h = solver.t - a;
      let before = a;
      for (let k = 1; k <= LOOKS && !this.pending; k++) {
        const t = k === LOOKS ? solver.t : a + (k / LOOKS) * h, y = solver.at(t);
        phase.exits.forEach((exit, i) => {
          const side = this.armed[i], value = (at) => (side || exit.side) * exit.value(at, solver.at(at), this.p)[0];
          let [low, high] = [before, t];
          if (!side) {
            // The motion began at the bound, to rounding, and went beyond it.
            if (exit.side && value(t) < -this.noise(phase, exit.value, t, y)) high = before;
            else return;
          } else if (value(t) > 0) return;
          for (let n = 0; n < HALVINGS && high > low; n++) {
            const middle = low + (high - low) / 2;
            if (value(middle) > 0) low = middle;
            else high = middle;
          }
          if (!this.pending || high < this.pending.t) this.pending = { t: high, y: this.onto(high, solver.at(high)), exit: i };
        });
        this.arm(t, y);
        before = t;
      }
    }

    // A state within a step, projected onto the constraints.
    onto(t, y) { return this.phase.projects ? this.phase.consistent(t, y, this.p) : y; }

    // Pass through the next exit.
    leave() {
      const { t, y, exit: number } = this.pending, { p } = this, exit = this.phase.exits[number], since = this.entered ?? -Infinity;
      this.hurried = t - since < AT_ONCE * this.span ? this.hurried + 1 : 0;
      this.entered = t;
      if (this.hurried > MOST_AT_ONCE) { this.failed = "impacts without end"; return false; }
      const [lasts, ...next] = exit.after(t, y, p), later = t + lasts;
      const to = exit.choose ? exit.to[exit.choose(later, next, p)[0]] : exit.to.length > 1 ? this.following(exit.to, this.index, later, next) : exit.to[0];
      this.enter(later, next, to);
      return true;
    }

    // Go to a time, unless the clock runs out; returns whether it got there.
    to(t, until = Infinity) {
      while (!this.ended) {
        if (this.failed || this.solver.failed) { this.failed ||= this.solver.failed; return false; }
        if (this.pending) {
          if (this.pending.t > t) return true;
          if (!this.leave()) return false;
        } else {
          if (this.solver.t >= t) return true;
          if (!this.solver.step(Infinity)) continue;
          this.crawled ??= this.solver.crawled;
          if (this.phase.exits.length) this.look();
          this.passed?.(this.solver.before, this.pending?.t ?? this.solver.t);
        }
        if (until < Infinity && performance.now() > until) return this.t > t;
      }
      return true;
    }

    // The state at a time within the last step.
    at(t) {
      if (this.ended) return this.ended.y;
      return t >= this.solver.t || t < this.solver.before ? this.solver.y : this.solver.at(t);
    }
  }
  return Object.assign(Motion, { variant });
})();
