// The motion of a scene from the functions that `jaxdyn.player.model` wrote, by `dop853.js`: through
// phases, each of which is smooth and ends by one of its exits. A page and Node run it alike.
"use strict";

var JaxdynMotion = (() => {
  const LOOKS = 8; // times within a step at which exits are looked at
  const HALVINGS = 60; // of the part of a step in which an exit is found
  const ROUNDINGS = 256 * 2 ** -52; // of all that enters a value: it is zero within these
  const ON = 1e-10; // of a state's largest entry: on a constraint, it is moved by no more
  const AT_ONCE = 1e-9, MOST_AT_ONCE = 60; // of the span, of exits one after the other

  // The scene of a model with the switches whose binary digits are 1: those of effects come first.
  const variant = (model, on) => model.variants[on % model.variants.length];

  class Motion {
    // From y at t, with the parameters p and the switches that are on. `passed` is called after each
    // step with the times between which it went; its states are those of at(t).
    constructor(model, p, on, t, y, { rtol, span = model.data.span, passed = null } = {}) {
      Object.assign(this, { model, p, on, rtol, span, passed });
      this.crawled = null;
      this.failed = "";
      this.hurried = 0; // exits one after the other
      // An exit that is switched off is no bound either: the phase goes on beyond it.
      const corners = Math.floor(on / model.variants.length), stays = (exit) => exit.switch < 0 || (corners >> exit.switch) & 1;
      const phases = this.phases = variant(model, on).phases.map((phase) => ({ ...phase, exits: phase.exits.filter(stays) }));
      const first = phases.length > 1 ? this.following(phases.map((_, i) => i), -1, t, y) : 0;
      this.enter(t, y, Math.max(first, 0));
    }

    get phase() { return this.phases[this.index]; }

    // The time that is reached, and whether it has crawled.
    get t() { return this.ended ? Infinity : this.pending ? this.pending.t : this.solver.t; }

    // Begin a phase; -1 is the end, where the state stays as it is.
    enter(t, y, index) {
      const { p, span, rtol } = this, { data } = this.model;
      this.pending = null;
      if (index < 0) { this.ended = { t, y }; return; }
      this.index = index;
      const phase = this.phase, sizes = this.solver?.sizes;
      this.solver = new Dop853((at, z) => phase.rate(at, z, p), t, y, {
        span, rtol, groups: data.groups, rough: data.rough,
        project: phase.projects ? (at, z) => phase.consistent(at, z, p) : null,
      });
      if (sizes) this.solver.sizes = this.solver.sizes.map((x, g) => Math.max(x, sizes[g])); // of all phases
      if (!phase.exits.length) return;
      const beyond = this.beyond(phase, t, y).indexOf(true);
      if (beyond >= 0) { this.pending = { t, y, exit: beyond }; return; }
      // An exit is armed once its value is off zero, on the near side where it has one.
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

    // What a value of a state changes by roundings of all that enters it.
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

    // The first phase of some that a state fits, the one that is left only if no other does, else
    // the first on whose constraints it is; the end fits always.
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
            // It began at the bound, to rounding, and went beyond it.
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

    // A state between the ends of a step, where it is on the constraints.
    onto(t, y) { return this.phase.projects ? this.phase.consistent(t, y, this.p) : y; }

    // Through the exit that is next.
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

    // To a time, unless the clock runs out; whether it got there.
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

    // The state at a time up to which it has gone, within the last step.
    at(t) {
      if (this.ended) return this.ended.y;
      return t >= this.solver.t || t < this.solver.before ? this.solver.y : this.solver.at(t);
    }
  }
  return Object.assign(Motion, { variant });
})();
