// A scene that runs on a page: integrated by `motion.js` from the functions that
// `jaxdyn.player.model` wrote, drawn by `canvas.js`. Pages put [element, model] into `liveScenes`;
// the element's `live` has play(), pause(), step(), reset(), seek(t), set(name, value),
// enter(i, value), switched(i, on), several(count), choose(i), cut(section), drag(mark, place) and
// state().
"use strict";

(() => {
  const { KINDS, Paper, Turn, View, disc, fitted, line, themed } = JaxdynCanvas;
  const PACES = [0.05, 0.1, 0.25, 0.5, 1, 2, 4, 16, 64];
  const LONGEST = 60, SHORTEST = 4; // [s] of spans in real time, at pace 1; longer ones in LONG, others in SHORTEST
  const LONG = 12;
  const BEAT = 1 / 240; // [s] between two samples of a trail and a plot, at pace 1
  const MOST_SAMPLES = 6000;
  const MOST_DRAWN = 1500; // samples of a curve that are drawn
  const FRAME = 12; // [ms] of computation between two pictures
  const LOOK = 250; // [ms] to look ahead for the box of the motion
  const REACH = { mouse: 26, touch: 44, pen: 30 }; // [px] distance at which a body is caught
  const TURN = Math.PI / 24, ZOOM = 1.15; // per key press
  const MARGIN = 1.12, LEAST_SHARE = [0, 0, 0.25, 0.5]; // as `drawing.panels.limits`
  const COUNTS = [1, 2, 3, 4, 5, 10, 20];
  const NUDGE = 1e-6; // relative to an entry, for finite differences
  const STILL = 1e-3; // relative to its size: an entry that changes less is not plotted by default
  const STEP = 1e-5; // relative to the span, for differences in time
  const ARROW = 0.2; // relative to the picture: the longest vector
  const SHOWN_ALONE = 6; // numbers in an array of parameters; larger ones are folded
  const SEEN = 200, SEEN_WHOLE = 600; // samples of the look ahead, and of a path that is drawn
  const LOOKS = 8, HALVINGS = 60; // evaluations of a section within a step; bisections of a crossing
  const MOST_CROSSINGS = 20000; // of a motion
  const MOST_PROJECTIONS = 20, ON = 1e-14; // onto constraints; relative to a state: one that moves less is on them
  const OFF = 1e-9; // relative to a state: one that projection moves more is off the constraints
  const STEADY = 1e-9; // relative to a rate: one that changes less is constant
  const NARROW = 760; // [px] width below which everything is in one column
  const WAYS = [[1, "upwards"], [-1, "downwards"], [0, "both ways"]];
  // The bounds of numbers, in the words of the library's checks.
  const BOUNDS = { "": () => true, "> 0": (x) => x > 0, ">= 0": (x) => x >= 0, "between 0 and 1": (x) => x >= 0 && x <= 1 };
  const SMALLEST = 1e-3; // relative to the range of a slider whose numbers are above zero

  const wrapped = (x) => x - 2 * Math.PI * Math.round(x / (2 * Math.PI));
  const short = (x, digits = 6) => {
    if (!Number.isFinite(x)) return "not a number";
    const figure = +x.toPrecision(digits);
    return figure && Math.abs(figure) < 1e-3 ? figure.toExponential() : String(figure);
  };
  const distance = (a, b) => Math.hypot(...a.map((x, d) => x - b[d]));
  // The next round number that is not smaller.
  const round = (x) => { const power = 10 ** Math.floor(Math.log10(x)); return [1, 2, 5, 10].find((k) => k * power >= x * (1 - 1e-12)) * power; };

  // The box of points with a margin, not too narrow, not empty.
  function limits(points, equal) {
    const dim = points[0].length, lo = [], hi = [];
    for (let d = 0; d < dim; d++) {
      lo[d] = Infinity; hi[d] = -Infinity;
      for (const p of points) { if (p[d] < lo[d]) lo[d] = p[d]; if (p[d] > hi[d]) hi[d] = p[d]; }
    }
    const middle = lo.map((x, d) => (x + hi[d]) / 2), halves = lo.map((x, d) => (hi[d] - x) / 2), most = Math.max(...halves);
    const half = halves.map((h, d) => {
      const size = equal ? Math.max(h, LEAST_SHARE[dim] * most) : h;
      return MARGIN * (size > 1e-6 * Math.abs(middle[d]) ? size : Math.max(Math.abs(middle[d]), 1) / 2);
    });
    return [middle.map((x, d) => x - half[d]), middle.map((x, d) => x + half[d])];
  }

  // The solution of a small symmetric system, by elimination.
  function solved(rows, right) {
    const n = right.length, a = rows.map((row, i) => [...row, right[i]]);
    for (let c = 0; c < n; c++) {
      const best = a.slice(c).reduce((at, row, i) => (Math.abs(row[c]) > Math.abs(a[at][c]) ? c + i : at), c);
      [a[c], a[best]] = [a[best], a[c]];
      for (let r = c + 1; r < n; r++) {
        const f = a[r][c] / a[c][c];
        for (let k = c; k <= n; k++) a[r][k] -= f * a[c][k];
      }
    }
    const x = new Array(n).fill(0);
    for (let r = n - 1; r >= 0; r--) x[r] = (a[r][n] - x.reduce((sum, v, k) => sum + (k > r ? a[r][k] * v : 0), 0)) / a[r][r];
    return x;
  }

  // The times between two, within the last step of a motion, at which it crosses a section: an entry
  // passes a level, or, where `entry` is -1, the time is a multiple of it.
  function crossings({ entry, level, way, angle }, motion, from, to) {
    const found = [];
    if (entry < 0) {
      for (let k = Math.floor(from / level) + 1; level > 0 && k * level <= to; k++) found.push(k * level);
      return found;
    }
    const off = (t) => { const x = motion.at(t)[entry] - level; return angle ? wrapped(x) : x; };
    let early = from, before = off(from);
    for (let k = 1; k <= LOOKS; k++) {
      const late = k === LOOKS ? to : from + (k / LOOKS) * (to - from), after = off(late);
      const [rises, falls] = [before < 0 && after >= 0, before > 0 && after <= 0];
      // An angle wraps half a turn from the level, which is not a crossing.
      if (((rises && way >= 0) || (falls && way <= 0)) && !(angle && Math.abs(after - before) > Math.PI)) {
        let [low, high] = [early, late];
        for (let n = 0; n < HALVINGS; n++) {
          const middle = low + (high - low) / 2;
          if (off(middle) < 0 === rises) low = middle;
          else high = middle;
        }
        found.push(high);
      }
      [early, before] = [late, after];
    }
    return found;
  }

  let ids = 0; // of the fields of all scenes on the page

  // One motion on the page: where it is now, its samples, and where it crossed the section.
  class Run {
    // From a start, with parameters p.
    constructor(scene, start, p) {
      this.scene = scene;
      this.samples = []; // of the whole motion, for plots; thinned as it gets longer
      this.recent = []; // the last ones without thinning, for the trail
      this.stride = 1;
      this.pushed = 0;
      this.crossings = [];
      this.begin(0, start, p);
      this.push(0);
    }

    begin(t, y, p) {
      const { model, on, span } = this.scene;
      this.p = p;
      this.crossings = this.crossings.filter((one) => one.t <= t); // steps run ahead of the picture
      this.motion = new JaxdynMotion(model, p, on, t, y, { span, passed: (from, to) => this.cross(from, to) });
      if (!this.scene.isConsistent(t, y, p)) this.motion.failed = "off constraints";
      this.now = y;
    }

    cross(from, to) {
      const { section } = this.scene;
      if (!section) return;
      for (const t of crossings(section, this.motion, from, to)) this.crossings.push({ t, y: this.motion.at(t) });
      if (this.crossings.length > MOST_CROSSINGS) this.crossings.splice(0, MOST_CROSSINGS / 2);
    }

    push(t) {
      const y = this.motion.at(t), { scene } = this, [first = this] = scene.runs ?? [], sample = { t, y, marks: scene.places(t, y, this.p).marks, energies: scene.energies(t, y, this.p) };
      sample.apart = distance(y, first.motion.at(t));
      this.recent.push(sample);
      if (this.recent.length > MOST_SAMPLES) this.recent.splice(0, MOST_SAMPLES / 2);
      if (this.pushed++ % this.stride) return;
      this.samples.push(sample);
      if (this.samples.length <= MOST_SAMPLES) return;
      this.samples = this.samples.filter((_, i) => i % 2 === 0);
      this.stride *= 2;
    }
  }

  class Live {
    constructor(root, model) {
      this.root = root;
      this.model = model;
      this.data = model.data;
      const d = this.data;
      this.choice = 0;
      this.hold(this.givenStarts());
      this.flat = d.axes.named.length; // dimensions of the functions
      this.dim = Math.max(2, this.flat);
      this.labels = this.flat === 1 ? [...d.axes.named, ""] : d.axes.named;
      this.turn = new Turn();
      this.pace = 1;
      this.trail = 0.25;
      this.playing = false;
      const { span } = this;
      this.speed = span >= 1 && span <= LONGEST ? 1 : span / (span > LONGEST ? LONG : SHORTEST);
      this.beat = this.speed * BEAT;
      this.loop = this.fit(); // of an orbit
      this.offset = this.aside();
      this.section = this.plane();
      this.build();
      this.reset();
      this.ranges();
      this.resize();
    }

    // The functions of the model with the current parameters and effects.
    rate(t, y) { return this.runs[0].motion.phase.rate(t, y, this.p); }
    energies(t, y, p = this.p) { return this.data.terms.length ? JaxdynMotion.variant(this.model, this.on).energies(t, y, p) : []; }

    // The nearest state on the constraints, or the given one if none is found; each call of the function
    // is a few steps of Newton's method.
    consistent(given, t = 0, p = this.p) {
      let y = given;
      for (let n = 0, moved = Infinity; this.model.consistent && n < MOST_PROJECTIONS && moved > ON; n++) {
        const next = this.model.consistent(t, y, p);
        moved = distance(next, y) / Math.hypot(...next);
        y = next;
      }
      return this.isConsistent(t, y, p) ? y : given;
    }

    // Whether a state satisfies the constraints.
    isConsistent(t, y, p) {
      if (!this.model.consistent) return true;
      const next = this.model.consistent(t, y, p);
      return distance(next, y) <= OFF * (Math.hypot(...next) || 1);
    }

    // The marked points and the corners of all shapes.
    places(t, y, p = this.p) {
      const flat = this.model.places(t, y, p), d = this.flat, marks = [], shapes = [];
      let at = 0;
      const take = () => { const place = flat.slice(at, at + d); at += d; if (d === 1) place.push(0); return place; };
      for (const _ of this.data.marks) marks.push(take());
      for (const shape of this.data.shapes) {
        const known = Array.from({ length: shape.computed }, take);
        shapes.push(shape.weights ? shape.weights.map((row) => known[0].map((_, k) => row.reduce((sum, w, i) => sum + w * known[i][k], 0))) : known);
      }
      return { marks, shapes };
    }

    // ------------------------------------------------------------------ the motion

    reset() {
      this.t = 0;
      this.beats = 0;
      this.runs = []; // filled in order, since the others measure their distance from the first
      for (let i = 0; i < this.count; i++) this.runs.push(this.makeRun(i));
      this.say(this.failure());
      this.draw();
    }

    // A motion at its start: the first one is that of the fields.
    makeRun(i) {
      const y = [...(this.together && i ? this.starts[i].start : this.start)], p = this.numbersOf(i);
      if (i && !this.together) y[this.offset.entry] += i * this.offset.size;
      return new Run(this, i ? this.consistent(y, 0, p) : y, p);
    }

    // The parameters of a motion; changes apply to all motions.
    numbersOf(i) { return this.together && i ? this.starts[i].parameters.map((x, j) => (this.changed.has(j) ? this.p[j] : x)) : this.p; }

    // Continue from the current state with other parameters or effects.
    goOn() {
      if (this.t === 0) { this.begin(this.start); return; }
      this.fields();
      this.runs.forEach((run, i) => { const p = this.numbersOf(i); run.begin(this.t, this.consistent(run.now, this.t, p), p); });
      this.say(this.failure());
      this.draw();
    }

    // To a time, with samples on the way; stops when `budget` ms are over.
    advance(t, budget = Infinity) {
      const until = performance.now() + budget;
      for (;;) {
        const next = (this.beats + 1) * this.beat, to = Math.min(next, t);
        for (const run of this.runs) if (!run.motion.to(to, until)) { this.show(Math.min(to, ...this.runs.map((r) => r.motion.t))); return false; }
        if (next > t) break;
        this.beats++;
        for (const run of this.runs) run.push(next);
      }
      this.show(t);
      return true;
    }

    show(t) {
      this.t = Math.max(this.t, t);
      for (const run of this.runs) run.now = run.motion.at(this.t);
    }

    // Why and where a motion ended or became inexact; empty otherwise.
    failure() {
      const motions = this.runs.map((run) => run.motion), failed = motions.find((motion) => motion.failed);
      const rough = motions.find((motion) => motion.crawled !== null), ended = motions.find((motion) => motion.ended && motion.ended.t <= this.t);
      if (failed?.failed === "off constraints") return "No state near this one satisfies the constraints, so nothing moves. Change the start or a parameter.";
      if (failed) {
        const why = { "not a number": "the rate is not a number there", "impacts without end": "impacts follow each other faster and faster" }[failed.failed] || "a singularity is near";
        return `The motion ends at t = ${short(failed.t, 4)}: ${why}. ${this.data.singular} Change the start or a parameter.`;
      }
      if (rough) return `From t = ${short(rough.crawled, 4)} on, a condition switches at each step, as in dry friction that sticks: the motion is only as accurate as the picture shows.`;
      return ended ? `The motion came to its end at t = ${short(ended.ended.t, 6)}.` : "";
    }

    play() {
      if (this.playing) return;
      this.playing = true;
      this.button.textContent = "Pause";
      let last = performance.now();
      const step = (now) => {
        if (!this.playing) return;
        const passed = Math.min(0.1, Math.max(0, (now - last) / 1000)) * this.speed * this.pace;
        last = now;
        const before = this.t;
        this.advance(this.t + passed, FRAME);
        this.late = this.t - before < 0.7 * passed;
        this.draw();
        if (this.failure()) this.say(this.failure());
        const motions = this.runs.map((run) => run.motion);
        if (motions.some((motion) => motion.failed) || motions.every((motion) => motion.ended)) { this.pause(); this.say(this.failure()); return; }
        requestAnimationFrame(step);
      };
      requestAnimationFrame(step);
    }

    pause() {
      if (!this.playing) return;
      this.playing = false;
      this.button.textContent = "Play";
      this.say(`Paused at t = ${this.time()}.`);
      this.draw();
    }

    toggle() { if (this.playing) this.pause(); else this.play(); }

    step() {
      this.pause();
      this.advance(this.t + (this.speed * this.pace) / 30);
      this.say(this.failure() || `t = ${this.time()}.`);
      this.draw();
    }

    seek(t) {
      this.pause();
      if (t < this.t) this.reset();
      this.advance(t);
      this.say(this.failure());
      this.draw();
    }

    // ------------------------------------------------------------------ changes

    set(name, value) {
      const i = this.data.parameters.findIndex((one) => one.name === name);
      if (i < 0 || !this.fits(value, this.data.parameters[i].bound)) return;
      this.p[i] = value;
      this.changed.add(i);
      this.goOn();
    }

    fits(value, bound = "") { return Number.isFinite(value) && BOUNDS[bound](value); }

    enter(i, value) {
      if (!this.fits(value)) return;
      this.start[i] = value;
      this.begin(this.start);
    }

    // From another start.
    begin(y) {
      this.start = [...this.consistent(y)];
      this.fields();
      this.reset();
    }

    switched(i, on) {
      this.on = on ? this.on | (1 << i) : this.on & ~(1 << i);
      this.goOn();
    }

    // The number of motions, from starts near the first one; 0 for the given ones.
    several(count) { this.together = !count; this.count = count || this.starts.length; this.reset(); }

    // Adopt the parameters and effects of some starts, which run side by side, without drawing yet.
    hold(starts) {
      const [{ start, span, parameters, off }] = this.starts = starts;
      this.together = starts.length > 1;
      this.count = this.together ? starts.length : this.data.motions;
      this.p = [...parameters];
      this.changed = new Set(); // parameters that differ from those of the starts
      this.span = span;
      this.on = this.data.switches.reduce((on, { effects }, i) => (effects.length && effects.every((e) => off.includes(e)) ? on : on | (1 << i)), 0);
      this.start = this.consistent([...start]);
    }

    // The starts of the page, or the selected one.
    givenStarts() { return this.data.choose ? [this.data.starts[this.choice]] : this.data.starts; }

    take(starts) {
      this.pause();
      this.hold(starts);
      this.loop = this.fit();
      for (const [i, box] of this.switches.entries()) box.checked = Boolean((this.on >> i) & 1);
      this.numbers.forEach((field, i) => field.around(this.p[i]));
      this.fields();
      this.ranges();
      this.showCount();
      this.reset();
    }

    choose(i) {
      this.choice = i;
      this.take(this.givenStarts());
      this.showChoice();
    }

    // Another section, from here on.
    cut(section) {
      this.section = { ...this.section, ...section };
      this.section.angle = this.data.entries[this.section.entry]?.unit === "rad";
      for (const run of this.runs) run.crossings = [];
      this.draw();
    }

    // The start that brings a marked point to a position, or as near as possible: Gauss-Newton for
    // the smallest change of the coordinates on the constraints; the velocities are kept.
    drag(mark, place) {
      const d = this.flat, k = this.start.length;
      const at = (y) => this.places(0, y).marks[mark].slice(0, d);
      const off = (y) => at(y).map((x, i) => place[i] - x);
      let y = this.consistent(this.start.map((x, i) => (this.movers[i] ? this.held[i] : x)));
      let miss = off(y), size = Math.hypot(...miss);
      for (let n = 0; n < 30; n++) {
        const columns = y.map((x, i) => {
          if (!this.movers[i]) return new Array(d).fill(0);
          const h = NUDGE * (1 + Math.abs(x)), two = [1, -1].map((sign) => at(this.consistent(y.map((z, j) => (j === i ? z + sign * h : z)))));
          return two[0].map((a, c) => (a - two[1][c]) / (2 * h));
        });
        const gram = Array.from({ length: d }, (_, a) => Array.from({ length: d }, (_, b) => columns.reduce((sum, c) => sum + c[a] * c[b], 0)));
        const trace = gram.reduce((sum, row, a) => sum + row[a], 0);
        if (!(trace > 0)) break;
        for (let a = 0; a < d; a++) gram[a][a] += 1e-7 * trace;
        const weights = solved(gram, miss);
        let share = 1, better = null;
        for (; share > 1e-3; share /= 2) {
          const tried = this.consistent(y.map((x, i) => x + share * columns[i].reduce((sum, c, a) => sum + c * weights[a], 0)));
          const left = off(tried);
          if (Math.hypot(...left) < size) { better = [tried, left]; break; }
        }
        if (!better) break;
        const gained = size - Math.hypot(...better[1]);
        [y, miss] = better;
        size = Math.hypot(...miss);
        if (gained < 1e-9 * (size + Math.hypot(...place))) break;
      }
      this.held = y;
      this.begin(Array.from({ length: k }, (_, i) => y[i]));
    }

    // A body is caught where it is now: the current coordinates become those of the start.
    grab() {
      const now = this.runs[0].now, all = (y) => this.places(this.t, y).marks.flat();
      this.movers = now.map((x, i) => {
        const h = 1e-4 * (1 + Math.abs(x)), [a, b] = [1, -1].map((sign) => all(now.map((z, j) => (j === i ? z + sign * h : z))));
        return a.some((v, c) => Math.abs(v - b[c]) > 1e-9 * h);
      });
      this.held = [...now];
    }

    // The box of the motion over its span, from a look ahead, and the path of the marked points.
    fit() {
      const looks = Array.from({ length: this.together ? this.count : 1 }, (_, i) => this.makeRun(i)), until = performance.now() + LOOK, points = [], count = this.data.whole ? SEEN_WHOLE : SEEN;
      const seen = this.start.map(Math.abs), least = [...this.start], most = [...this.start], rates = [];
      const loop = [];
      for (let i = 0; i <= count * looks.length; i++) {
        const look = looks[i % looks.length], t = (Math.floor(i / looks.length) / count) * this.span;
        if (!look.motion.to(t, until)) break;
        const y = look.motion.at(t), { marks, shapes } = this.places(t, y, look.p);
        rates.push(look.motion.phase.rate(t, y, look.p));
        loop.push(marks);
        y.forEach((x, j) => { seen[j] = Math.max(seen[j], Math.abs(x)); least[j] = Math.min(least[j], x); most[j] = Math.max(most[j], x); });
        points.push(...marks, ...shapes.flatMap((s, k) => (this.data.shapes[k].kind === "ground" ? [] : s)));
      }
      const finite = points.filter((p) => p.every(Number.isFinite));
      this.box = limits(finite.length ? finite : [new Array(this.dim).fill(0)], this.data.axes.equal);
      this.seen = seen;
      this.moves = least.map((x, j) => most[j] - x > STILL * this.size(j));
      this.middle = least.map((x, j) => (x < 0 && most[j] > 0 ? 0 : +((x + most[j]) / 2).toPrecision(2)));
      this.steady = rates[0].map((x, j) => rates.every((rate) => Math.abs(rate[j] - x) <= STEADY * Math.abs(x)));
      return loop;
    }

    // The initial section: at a value of the phase of a forcing, or of the first entry that moves;
    // another entry is drawn with its velocity.
    plane() {
      const { entries } = this.data, k = entries.length, moving = entries.map((_, i) => i).filter((i) => this.moves[i]);
      const drive = moving.find((i) => entries[i].unit === "rad" && this.steady[i]), entry = drive ?? (k % 2 ? moving.at(-1) : moving[0]) ?? 0;
      const [one = 0, two = one] = moving.filter((i) => i !== entry), half = k / 2;
      const pair = k % 2 === 0 && one < half ? one + half : two;
      return { entry, level: drive === undefined ? this.middle[entry] : 0, way: 1, angle: entries[entry].unit === "rad", across: 1 + one, up: 1 + pair };
    }

    // A thousandth, rounded, of the first entry that moves, in a direction that is not beyond a stop.
    aside() {
      const entry = Math.max(0, this.moves.indexOf(true)), size = Math.min(this.size(entry), this.data.groups.most[entry] ?? Infinity);
      const apart = 10 ** (Math.floor(Math.log10(size || 1)) - 3);
      const moves = (way) => {
        const y = this.consistent(this.start.map((x, i) => (i === entry ? x + way * apart : x)));
        return !new JaxdynMotion(this.model, this.p, this.on, 0, y, { span: this.span }).pending;
      };
      return { entry, size: apart * ([1, -1].find(moves) ?? 1) };
    }

    // The largest entry of a kind in the look ahead.
    size(i) {
      const { of } = this.data.groups;
      return Math.max(...this.seen.filter((_, j) => of[j] === of[i]));
    }

    // A body that leaves the box enlarges it.
    follow() {
      const [lo, hi] = this.box, points = this.runs.flatMap((run) => this.places(this.t, run.now, run.p).marks);
      if (points.every((p) => p.every((x, d) => !Number.isFinite(x) || (x >= lo[d] && x <= hi[d])))) return;
      const finite = points.filter((p) => p.every(Number.isFinite));
      if (finite.length) this.box = limits([...finite, lo.map((x, d) => x + 0.05 * (hi[d] - x)), hi.map((x, d) => x - 0.05 * (x - lo[d]))], false);
    }

    state() {
      const { t, playing, p, on, start } = this, phases = this.runs.map((run) => run.motion.phase.name), now = this.runs.map((run) => Array.from(run.now));
      const crossings = this.runs.map((run) => run.crossings.filter((one) => one.t <= t));
      return { t, playing, start, phases, parameters: p, on, now, crossings, points: this.runs.map((run) => this.places(t, run.now, run.p).marks), energies: this.runs.map((run) => this.energies(t, run.now, run.p)), failure: this.failure() };
    }

    // ------------------------------------------------------------------ the page

    build() {
      const { root, data } = this;
      this.switches = [];
      const stage = this.make("div", { className: "scene" }), panels = this.make("div", { className: "panels" });
      if (data.starts.length > 1 && data.choose) this.chooser(stage);
      this.canvas = this.make("canvas", { className: "stage", tabIndex: 0 }, stage);
      this.canvas.setAttribute("role", "application");
      this.canvas.setAttribute("aria-label", `${data.name}, drawn. ${this.keys()} The fields under Start and Parameters replace dragging.`);
      const bar = this.make("div", { className: "controls" }, stage);
      this.button = this.press("Play", () => this.toggle(), bar);
      this.press("Step", () => this.step(), bar);
      this.press("Reset", () => { this.pause(); this.fit(); this.reset(); this.say("At the start."); }, bar);
      this.paces = this.select("speed", PACES.map((x) => [x, `${short(x * this.speed, 2)} ${data.second ? "x" : "per s"}`]), 1, (x) => { this.pace = +x; }, bar);
      this.select("trail", [[0, "no trail"], [0.25, "trail"], [1, "long trail"]], 0.25, (x) => { this.trail = +x; this.draw(); }, bar);
      this.clock = this.make("span", { className: "clock" }, bar);
      this.said = this.make("p", { className: "said" }, stage);
      this.status = this.make("p", { className: "status" }, stage);
      this.status.setAttribute("role", "status");
      this.legend = this.make("p", { className: "legend" }, stage);
      this.make("p", { className: "hint", textContent: `Drag a body to set the start. Keys: ${this.keys()}` }, stage);
      const plots = this.make("div", { className: "plots" });
      this.plots = data.curve ? [this.curve(plots)] : [];
      this.plots.push(this.plot(plots, 0), this.plot(plots, 1), this.sectionPlot(plots));
      if (data.asks.length) this.askPanel(panels);
      this.startPanel(panels);
      this.parameterPanel(panels);
      if (data.switches.length) this.effectPanel(panels);
      this.vectorPanel(panels);
      this.severalPanel(panels);
      this.listen();
    }

    make(tag, set, parent = this.root) { return parent.appendChild(Object.assign(document.createElement(tag), set)); }

    press(text, does, parent) {
      const button = this.make("button", { type: "button", textContent: text }, parent);
      button.addEventListener("click", does);
      return button;
    }

    select(label, choices, chosen, does, parent) {
      const list = this.make("select", {}, parent);
      list.setAttribute("aria-label", label);
      for (const [value, text] of choices) this.make("option", { value, text, selected: value === chosen }, list);
      list.addEventListener("change", () => does(list.value));
      return list;
    }

    panel(title, parent, open = true) {
      const panel = this.make("details", { open }, parent);
      this.make("summary", { textContent: title }, panel);
      return panel;
    }

    // Calls `does` with each number that is typed into a field and fits a bound. When the field is
    // left, it shows the number in use again, and why another text was not taken.
    typed(input, said, bound, does, used) {
      const valid = () => input.value !== "" && this.fits(+input.value, bound);
      input.addEventListener("input", () => { input.setAttribute("aria-invalid", !valid()); if (valid()) does(+input.value); });
      const settle = () => {
        if (!valid()) this.say(`${said}: a number${bound && ` ${bound}`} is expected; it is still ${short(used())}.`);
        input.value = short(used());
        input.setAttribute("aria-invalid", false);
      };
      for (const name of ["change", "blur"]) input.addEventListener(name, settle);
    }

    // A slider and a field for one number; `set` shows another one.
    field({ name, unit, bound = "", meaning = "" }, value, does, parent) {
      const row = this.make("div", { className: "field", title: meaning }, parent), id = `live-${ids++}`;
      const said = unit ? `${name} [${unit}]` : name;
      this.make("label", { htmlFor: id, textContent: said }, row);
      const slider = this.make("input", { type: "range", step: "any" }, row), number = this.make("input", { type: "number", step: "any", id, value: short(value) }, row);
      slider.setAttribute("aria-label", `${said}, slider`);
      let used = value;
      const set = (x) => {
        used = x;
        if (+slider.min > x) slider.min = x;
        if (+slider.max < x) slider.max = x;
        slider.value = x;
        slider.setAttribute("aria-valuetext", `${short(x, 4)} ${unit}`);
        if (document.activeElement !== number) number.value = short(x);
      };
      slider.addEventListener("input", () => does(+short(+slider.value)));
      this.typed(number, said, bound, does, () => used);
      const range = (low, high) => { slider.min = low; slider.max = high; };
      // For a number that keeps its sign, up to a round one that is twice as large.
      const around = (x) => {
        const twice = x ? round(2 * Math.abs(x)) : 1, far = bound.startsWith("between") ? Math.min(1, twice) : twice, least = bound === "> 0" ? SMALLEST * far : 0;
        range(x > 0 || bound ? least : -far, x < 0 ? 0 : far);
      };
      return { row, set, range, around };
    }

    // The slider for the choice of scenes.
    chooser(parent) {
      const { choose, starts, special } = this.data, row = this.make("div", { className: "chooser" }, parent), id = `live-${ids++}`;
      this.make("label", { htmlFor: id, textContent: choose }, row);
      const slider = this.make("input", { type: "range", min: 0, max: starts.length - 1, step: 1, value: 0, id }, row), said = this.make("p", { className: "said chosen" }, parent);
      slider.addEventListener("input", () => this.choose(+slider.value));
      if (special.length) {
        const list = this.make("datalist", { id: `live-${ids++}` }, row), jumps = this.make("div", { className: "controls" }, parent);
        slider.setAttribute("list", list.id);
        for (const [i, label] of special) {
          this.make("option", { value: i, label }, list);
          this.press(label, () => this.choose(i), jumps);
        }
      }
      this.showChoice = () => {
        const { name, note } = starts[this.choice];
        slider.value = this.choice;
        slider.setAttribute("aria-valuetext", name);
        said.textContent = `${name}${note ? `: ${note}` : ""}`;
        this.draw();
      };
      this.showChoice();
    }

    // Questions with their answers folded, and buttons that set up the situation.
    askPanel(parent) {
      const panel = this.panel("What happens when ...?", parent);
      for (const { question, answer, starts } of this.data.asks) {
        const one = this.make("div", { className: "ask" }, panel);
        this.make("p", { textContent: question }, one);
        if (starts.length) this.press("Try it", () => { this.take(starts); this.play(); this.say(question); this.canvas.scrollIntoView({ block: "nearest" }); }, one).setAttribute("aria-label", `Try it: ${question}`);
        const folded = this.make("details", {}, one);
        this.make("summary", { textContent: "Answer" }, folded);
        this.make("p", { textContent: answer }, folded);
      }
    }

    startPanel(parent) {
      const panel = this.panel("Start", parent, this.data.entries.length <= 12);
      this.entries = this.data.entries.map((entry, i) => this.field(entry, this.start[i], (x) => this.enter(i, x), panel));
      const bar = this.make("div", { className: "controls" }, panel);
      this.press("Start from here", () => { this.pause(); this.begin([...this.runs[0].now]); this.say("This is the new start."); }, bar);
      this.press("Original", () => { this.take(this.givenStarts()); this.say("Everything is reset."); }, bar);
    }

    parameterPanel(parent) {
      const { parameters } = this.data;
      this.numbers = [];
      if (!parameters.length) return;
      const few = parameters.some((one) => one.used && one.of <= SHOWN_ALONE), panel = few ? this.panel("Parameters", parent) : null;
      const rest = parameters.some((one) => one.used && one.of > SHOWN_ALONE) ? this.panel(few ? "More parameters" : "Parameters", parent, false) : null;
      // Parameters without effect in this scene are not shown, such as the phase of a constant force.
      this.numbers = parameters.map((one, i) => {
        if (!one.used) return { set() {}, around() {} };
        const field = this.field({ name: one.label, unit: one.unit, bound: one.bound, meaning: one.meaning }, one.value, (x) => this.set(one.name, x), one.of > SHOWN_ALONE ? rest : panel);
        field.around(this.p[i]);
        field.set(this.p[i]);
        return field;
      });
    }

    effectPanel(parent) {
      const panel = this.panel("Effects", parent);
      this.switches = this.data.switches.map(({ name }, i) => {
        const label = this.make("label", { className: "check" }, panel), box = this.make("input", { type: "checkbox", checked: Boolean((this.on >> i) & 1) }, label);
        label.append(name);
        box.addEventListener("change", () => this.switched(i, box.checked));
        return box;
      });
    }

    vectorPanel(parent) {
      const panel = this.panel("Vectors", parent, false), kinds = ["velocity", "acceleration", ...this.data.forces.map((one) => `force: ${one.name}`), ...this.data.spins.map((about) => `angular momentum about the ${about}`)];
      this.vectors = kinds.map((name, i) => {
        const label = this.make("label", { className: "check" }, panel), box = this.make("input", { type: "checkbox" }, label);
        const swatch = this.make("span", { className: "swatch" }, label);
        swatch.style.setProperty("--own", `var(--path-${(i + 2) % 7})`);
        label.append(name);
        box.addEventListener("change", () => { this.longest[i] = 0; this.draw(); });
        return box;
      });
      this.longest = kinds.map(() => 0);
    }

    severalPanel(parent) {
      const panel = this.panel("Several motions", parent, this.count > 1 && !this.together), row = this.make("div", { className: "controls" }, panel);
      const counts = [...new Set([...COUNTS, this.data.motions])].sort((a, b) => a - b).map((n) => [n, n === 1 ? "one" : `${n} motions`]);
      const list = this.select("how many motions", [[0, "as given"], ...counts], 0, (n) => this.several(+n), row);
      this.showCount = () => { list.options[0].hidden = this.starts.length < 2; list.value = this.together ? 0 : this.count; };
      this.showCount();
      this.select("entry in which they start apart", this.data.entries.map((one, i) => [i, one.name]), this.offset.entry, (i) => { this.offset.entry = +i; this.reset(); }, row);
      const apart = this.make("input", { type: "number", step: "any", value: this.offset.size }, row);
      apart.setAttribute("aria-label", "how far apart they start");
      this.typed(apart, "How far apart they start", "", (x) => { this.offset.size = x; this.reset(); }, () => this.offset.size);
      this.apart = this.make("p", { className: "said" }, panel);
    }

    // Update all fields to the current values.
    fields() {
      this.entries.forEach((field, i) => field.set(this.start[i]));
      this.numbers.forEach((field, i) => field.set(this.p[i]));
    }

    // The ranges of the sliders of the start, from the extent of the motion.
    ranges() {
      this.data.entries.forEach((entry, i) => {
        const far = entry.unit === "rad" ? Math.PI : round(1.2 * (this.size(i) || 1));
        this.entries[i].range(-far, far);
        this.entries[i].set(this.start[i]);
      });
    }

    keys() {
      return this.flat === 3 ? "space plays, s steps, r resets, arrows or dragging rotate the view, [ and ] zoom." : "space plays, s or the right arrow steps, r resets.";
    }

    say(text) { if (this.status.textContent !== text) this.status.textContent = text; }

    time() { return `${this.t.toFixed(Math.max(0, 2 - Math.floor(Math.log10(this.span || 1))))}${this.data.second ? ` ${this.data.second}` : ""}`; }

    listen() {
      this.canvas.addEventListener("keydown", (event) => this.key(event));
      this.pointers();
      new ResizeObserver(() => { this.root.classList.toggle("narrow", this.root.clientWidth < NARROW); this.resize(); }).observe(this.root);
      // On a phone the plots are mostly out of view, and cost as much as the rest.
      const seen = new IntersectionObserver((entries) => {
        for (const { target, isIntersecting } of entries) this.plots.find((plot) => plot.canvas === target).visible = isIntersecting;
        if (!this.playing) this.draw();
      });
      for (const plot of this.plots) seen.observe(plot.canvas);
      themed(() => this.draw());
    }

    key(event) {
      const turning = { ArrowLeft: [TURN, 0], ArrowRight: [-TURN, 0], ArrowUp: [0, -TURN], ArrowDown: [0, TURN] }[event.key];
      const zoom = { "]": ZOOM, "[": 1 / ZOOM }[event.key];
      if (event.altKey || event.ctrlKey || event.metaKey) return;
      if (this.flat === 3 && turning) this.turned(...turning);
      else if (this.flat === 3 && zoom) this.zoomed(zoom);
      else if (event.key === " ") this.toggle();
      else if (event.key === "s" || event.key === "ArrowRight") this.step();
      else if (event.key === "r" || event.key === "Home") { this.pause(); this.reset(); }
      else return;
      event.preventDefault();
    }

    turned(azimuth, height) {
      this.turn.rotate(azimuth, height);
      this.draw();
    }

    zoomed(by) {
      this.turn.enlarge(by);
      this.draw();
    }

    // A position on the canvas.
    pixels(event) {
      const box = this.canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    }

    // The marked point of the first motion at a position on the canvas, with its own position, and
    // how far beside it on the canvas it is held.
    caught(event) {
      const view = this.view, px = this.pixels(event);
      const { marks } = this.places(this.t, this.runs[0].now);
      const far = marks.map((m) => distance(view.map(m).slice(0, 2), px));
      const nearest = far.indexOf(Math.min(...far));
      return far[nearest] <= (REACH[event.pointerType] ?? REACH.touch) ? { mark: nearest, place: marks[nearest], aside: view.map(marks[nearest]).slice(0, 2).map((x, i) => px[i] - x) } : null;
    }

    pointers() {
      const { canvas } = this, held = new Map();
      let body = null, resume = false;
      canvas.classList.toggle("turns", this.flat === 3);
      // A finger on a body drags it; elsewhere it scrolls the page.
      canvas.addEventListener("touchstart", (e) => { if (e.touches.length === 1 && this.caught(Object.assign({}, { clientX: e.touches[0].clientX, clientY: e.touches[0].clientY, pointerType: "touch" }))) e.preventDefault(); }, { passive: false });
      canvas.addEventListener("pointerdown", (e) => {
        if (e.button) return;
        body = held.size ? null : this.caught(e);
        if (body) { resume = this.playing; this.pause(); this.grab(); }
        if (body || this.flat === 3) { held.set(e.pointerId, e); canvas.setPointerCapture(e.pointerId); }
      });
      canvas.addEventListener("pointermove", (e) => {
        const last = held.get(e.pointerId);
        if (!last) { canvas.style.cursor = this.caught(e) ? "grab" : ""; return; }
        // The picture may grow on the way: where the body was is looked up each time.
        if (body) this.drag(body.mark, this.view.moved(body.place, ...this.pixels(e).map((x, i) => x - body.aside[i] - this.view.map(body.place)[i])));
        else if (held.size === 1) this.turned((last.clientX - e.clientX) / 120, (e.clientY - last.clientY) / 120);
        else {
          const [other] = [...held.values()].filter((p) => p.pointerId !== e.pointerId), apart = (p) => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY);
          this.zoomed(apart(e) / Math.max(1, apart(last)));
        }
        held.set(e.pointerId, e);
      });
      for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (e) => {
        if (!held.delete(e.pointerId) || !body) return;
        body = null;
        this.say(`Start: ${this.data.entries.map((one, i) => `${one.name} ${short(this.start[i], 4)} ${one.unit}`).slice(0, 6).join(", ")}.`);
        if (resume) this.play();
      });
      canvas.addEventListener("wheel", (e) => {
        if (!e.ctrlKey || this.flat !== 3) return;
        e.preventDefault();
        this.zoomed(Math.exp(-e.deltaY / 300));
      }, { passive: false });
    }

    resize() {
      for (const canvas of [this.canvas, ...this.plots.map((plot) => plot.canvas)]) fitted(canvas);
      this.draw();
    }

    // ------------------------------------------------------------------ the picture

    draw() {
      if (!this.runs) return;
      this.follow();
      const view = this.view = new View(this.box, this.data.axes.equal, this.canvas.clientWidth, this.canvas.clientHeight, this.turn);
      const paper = new Paper(this.root, this.canvas), many = this.runs.length > 1;
      paper.frame(view, this.labels);
      paper.pen.save();
      paper.clip(view);
      if (this.data.whole) this.loop[0]?.forEach((_, j) => paper.tail(this.loop.map((marks) => view.map(marks[j])), paper.colour("ground"), true));
      // The first one is drawn last, in front of the others.
      for (let k = this.runs.length - 1; k >= 0; k--) this.motion(paper, view, this.runs[k], many ? k : null);
      this.vectorsOn(paper, view);
      paper.pen.restore();
      this.clock.textContent = `t = ${this.time()}`;
      this.tell();
      for (const plot of this.plots) if (plot.visible) plot.shown(plot);
    }

    motion(paper, view, run, k) {
      const { marks, shapes } = this.places(this.t, run.now, run.p), { data } = this;
      const own = (j) => paper.colour(`path-${(k ?? j) % 7}`);
      data.shapes.forEach((shape, s) => { if (shape.kind === "ground" && !k) for (const corners of this.lines(shape, shapes[s])) paper.ground(this.extended(corners, view).map((p) => view.map(p))); });
      for (const kind of KINDS)
        data.shapes.forEach((shape, s) => {
          if (shape.kind !== kind) return;
          for (const corners of this.lines(shape, shapes[s])) paper.stroke(view, kind, corners.map((p) => view.map(p)), k !== null && kind === "line" ? own(0) : null);
        });
      if (this.trail) {
        const since = this.t - this.trail * this.span, kept = run.recent.filter((sample) => sample.t >= since && sample.t <= this.t);
        marks.forEach((mark, j) => paper.tail([...kept.map((sample) => view.map(sample.marks[j])), view.map(mark)], own(j), false));
      }
      marks.forEach((mark, j) => { const [x, y] = view.map(mark); if (Number.isFinite(x + y)) disc(paper.pen, x, y, 5.5, own(j), paper.colour("paper")); });
    }

    // The selected vectors of the first motion: [position, components] for each kind; in a plane a
    // moment has one component.
    arrows() {
      const { t, data } = this, y = this.runs[0].now, h = STEP * this.span, found = [], after = 2 + data.forces.length;
      const [wanted, forces, spins] = [[0, 2], [2, after], [after]].map((part) => this.vectors.slice(...part).some((box) => box.checked));
      if (wanted) {
        // Finite differences along the motion are accurate enough for a picture.
        const f = this.rate(t, y), [g, e] = [1, -1].map((s) => this.rate(t + s * h, y.map((x, i) => x + s * h * f[i])));
        const at = (s) => this.places(t + s * h, y.map((x, i) => x + s * h * f[i] + (h * (g[i] - e[i])) / 4)).marks;
        const [before, here, after] = [-1, 0, 1].map((s) => (s ? at(s) : this.places(t, y).marks));
        found[0] = here.map((place, j) => [place, place.map((_, d) => (after[j][d] - before[j][d]) / (2 * h))]);
        found[1] = here.map((place, j) => [place, place.map((x, d) => (after[j][d] - 2 * x + before[j][d]) / (h * h))]);
      }
      if (forces) {
        const flat = this.model.forces(t, y, this.p), d = this.flat, n = flat.length / (d * (1 + data.forces.length));
        const point = (i) => [...flat.slice(i * d, (i + 1) * d), ...(d === 1 ? [0] : [])];
        data.forces.forEach((one, k) => {
          const s = data.switches.findIndex((name) => name.effects.includes(one.effect)), off = s >= 0 && !((this.on >> s) & 1);
          found[2 + k] = off ? [] : Array.from({ length: n }, (_, i) => [point(i), point((1 + k) * n + i)]);
        });
      }
      if (spins) {
        const flat = this.model.spin(t, y, this.p), d = this.flat, size = d === 3 ? 3 : 1;
        const about = [[new Array(d).fill(0), flat.slice(0, size)], [flat.slice(size, size + d), flat.slice(size + d)]];
        data.spins.forEach((_, i) => { found[after + i] = [about[i]]; });
      }
      return found;
    }

    vectorsOn(paper, view) {
      if (!this.vectors.some((box) => box.checked)) return;
      const longest = ARROW * Math.max(...this.box[0].map((x, d) => this.box[1][d] - x));
      this.arrows().forEach((kind, i) => {
        if (!this.vectors[i].checked) return;
        for (const [, v] of kind) { const size = Math.hypot(...v); if (size < Infinity) this.longest[i] = Math.max(this.longest[i], size); }
        if (!this.longest[i]) return;
        const scale = longest / this.longest[i], colour = paper.colour(`path-${(i + 2) % 7}`);
        for (const [place, v] of kind) {
          if (v.length < place.length) paper.moment(view.map(place), v[0] / this.longest[i], colour);
          else paper.arrow(view.map(place), view.map(place.map((x, d) => x + scale * v[d])), colour);
        }
      });
    }

    lines(shape, corners) { return Array.from({ length: shape.lines }, (_, m) => corners.slice(m * shape.corners, (m + 1) * shape.corners)); }

    // A straight ground extends through the whole picture.
    extended(corners, view) {
      if (corners.length !== 2 || view.dim === 3) return corners;
      const [a, b] = corners, length = distance(a, b) || 1, far = distance(...view.box) + distance(a, view.middle);
      return [-far, far].map((s) => a.map((x, d) => x + (s * (b[d] - x)) / length));
    }

    // The numbers of the first motion, and how far the others are from it.
    tell() {
      const { data, runs } = this, now = runs[0].now;
      const entries = data.entries.slice(0, 13).map((one, i) => `${one.name} = ${short(now[i], 5)}${one.unit ? ` ${one.unit}` : ""}`);
      const energies = this.energies(this.t, now), first = runs[0].samples[0].energies, unit = data.joule && ` ${data.joule}`;
      if (energies.length) {
        const sum = (list) => list.reduce((a, b) => a + b, 0);
        entries.push(`energy ${short(sum(energies), 6)}${unit}${this.t && first.length ? `, changed by ${(sum(energies) - sum(first)).toExponential(1)}${unit}` : ""}`);
      }
      if (runs[0].motion.phases.length > 1) entries.push(`phase: ${runs[0].motion.ended ? "end" : runs[0].motion.phase.name}`);
      this.said.textContent = entries.join("; ") + (this.late ? " (slower than requested, since it takes longer to compute)" : "");
      const named = this.together ? this.starts.map((one) => one.name) : runs.length > 1 ? runs.map((_, i) => (i ? `${this.offset.size < 0 ? "-" : "+"} ${short(i * Math.abs(this.offset.size), 3)}` : "start")) : data.marks;
      this.showLegend(this.legend, named.length > 8 ? [] : named.filter(Boolean));
      this.apart.textContent = runs.length > 1 && !this.together ? `The distance of the second motion from the first is ${distance(runs[1].now, now).toExponential(2)}; at the start it was ${Math.abs(this.offset.size).toExponential(2)}.` : "";
    }

    // ------------------------------------------------------------------ plots

    // The quantities that can be plotted: names, and the values of a sample; the last one needs
    // several motions.
    quantities() {
      const { data } = this, entries = data.entries.map((one, i) => ({ name: one.unit ? `${one.name} [${one.unit}]` : one.name, values: (s) => [s.y[i]], angle: one.unit === "rad" }));
      const found = [{ name: data.second ? `t [${data.second}]` : "t", values: (s) => [s.t] }, ...entries], unit = data.joule && ` [${data.joule}]`;
      if (data.terms.length) {
        const total = (s) => s.energies.reduce((a, b) => a + b, 0);
        found.push({ name: `energy${unit}`, values: (s) => [total(s)] });
        if (data.terms.length > 1) found.push({ name: `energies${unit}`, values: (s) => [...s.energies, total(s)], names: [...data.terms, "sum"] });
      }
      found.push({ name: "log10 of the distance", values: (s) => [s.apart ? Math.log10(s.apart) : NaN] });
      return found;
    }

    // By default, energies over time, and a moving coordinate with its velocity, or the next one.
    chosen(which, all) {
      const k = this.data.entries.length, first = Math.max(0, this.moves.indexOf(true)), energies = all.length - 2;
      if (!which && this.count > 1 && !this.together) return { across: 0, up: all.length - 1 };
      if (!which) return { across: 0, up: energies > k ? energies : 1 + first };
      const half = k / 2, next = this.moves.indexOf(true, first + 1);
      const other = k % 2 === 0 && first < half && this.moves[first + half] ? first + half : next;
      return other < 0 ? { across: 0, up: 1 + first } : { across: 1 + first, up: 1 + other };
    }

    plot(parent, which) {
      const box = this.make("div", { className: "plot" }, parent), bar = this.make("div", { className: "controls" }, box), all = this.quantities();
      const plot = { ...this.chosen(which, all), all };
      const choices = all.map((one, i) => [i, one.name]);
      bar.append("Plot ");
      this.select(`plot ${which + 1}: upwards`, choices.slice(1), plot.up, (i) => { plot.up = +i; this.draw(); }, bar);
      bar.append(" over ");
      this.select(`plot ${which + 1}: across`, choices.filter((_, i) => !all[i].names), plot.across, (i) => { plot.across = +i; this.draw(); }, bar);
      return this.further(box, "plot", (plot) => this.plotted(plot), plot);
    }

    plotted(plot) {
      const across = plot.all[plot.across], up = plot.all[plot.up], many = this.runs.length > 1;
      plot.canvas.setAttribute("aria-label", `${up.name} over ${across.name}`);
      const turn = (one, x) => (one.angle ? wrapped(x) : x), lines = [], points = [];
      this.runs.forEach((run, r) => {
        const sample = { t: this.t, y: run.now, energies: this.energies(this.t, run.now, run.p), apart: distance(run.now, this.runs[0].now) };
        const stride = Math.ceil(run.samples.length / MOST_DRAWN), n = up.values(sample).length;
        const kept = [...run.samples.filter((s, i) => i % stride === 0 && s.t < this.t), sample];
        for (let j = 0; j < n; j++) {
          let part = [];
          lines.push({ colour: many ? r : j, parts: [part] });
          for (const s of kept) {
            const p = [turn(across, across.values(s)[0]), turn(up, up.values(s)[j])], last = part[part.length - 1];
            if (!p.every(Number.isFinite)) continue;
            // An angle that passes half a turn reappears on the other side.
            if (last && ((across.angle && Math.abs(p[0] - last[0]) > Math.PI) || (up.angle && Math.abs(p[1] - last[1]) > Math.PI))) lines[lines.length - 1].parts.push((part = []));
            part.push(p);
            points.push(p);
          }
        }
      });
      const { paper, view } = this.chart(plot, points, [across.name, up.name]);
      if (!view) return;
      paper.pen.lineWidth = 1.5;
      for (const { colour, parts } of lines.reverse()) {
        paper.pen.strokeStyle = paper.colour(`path-${colour % 7}`);
        for (const part of parts) line(paper.pen, part.map((p) => view.map(p)));
        const last = parts[parts.length - 1], end = last[last.length - 1];
        if (end) { const [x, y] = view.map(end); disc(paper.pen, x, y, 4, paper.pen.strokeStyle, paper.colour("paper")); }
      }
      this.showLegend(plot.legend, (!many && up.names) || []);
    }

    // A canvas with axes around points, and no view if there are no points.
    chart({ canvas }, points, labels) {
      const paper = new Paper(this.root, canvas);
      if (!points.length) return { paper };
      const view = new View(limits(points, false), false, canvas.clientWidth, canvas.clientHeight);
      paper.axes(view, labels);
      return { paper, view };
    }

    // A legend of names, in the order of the colours.
    showLegend(legend, names) {
      const text = names.join("|");
      if (legend.dataset.names === text) return;
      legend.dataset.names = text;
      legend.replaceChildren(...names.map((name, i) => {
        const entry = Object.assign(document.createElement("span"), { textContent: name });
        entry.style.setProperty("--own", `var(--path-${i % 7})`);
        return entry;
      }));
    }

    // The canvas of a further plot, and its drawing function.
    further(parent, label, shown, plot = {}) {
      plot.canvas = this.make("canvas", {}, parent);
      plot.canvas.setAttribute("role", "img");
      plot.canvas.setAttribute("aria-label", label);
      plot.legend = this.make("p", { className: "legend" }, parent);
      return { ...plot, visible: true, shown };
    }

    // Crossings of a section, while the motion runs.
    sectionPlot(parent) {
      const box = this.make("details", { className: "plot" }, parent), { section, data } = this, entries = data.entries.map((one, i) => [i, one.name]);
      this.make("summary", { textContent: "Section" }, box);
      const bar = this.make("div", { className: "controls" }, box), all = this.quantities().slice(0, 1 + entries.length), choices = all.map((one, i) => [i, one.name]);
      const drawn = (label, key) => this.select(`section: ${label}`, choices, section[key], (i) => { this.section[key] = +i; this.draw(); }, bar);
      bar.append("Plot ");
      drawn("upwards", "up");
      bar.append(" over ");
      drawn("across", "across");
      bar.append(" where ");
      this.select("section: what passes a level", [...entries.map(([i, name]) => [i, `${name} passes`]), [-1, "t is a multiple of"]], section.entry, (i) => this.cut({ entry: +i }), bar);
      const level = this.make("input", { type: "number", step: "any", value: section.level }, bar);
      level.setAttribute("aria-label", "section: level");
      this.typed(level, "The level of the section", "", (x) => this.cut({ level: x }), () => this.section.level);
      this.select("section: which way", WAYS, section.way, (way) => this.cut({ way: +way }), bar);
      box.addEventListener("toggle", () => this.resize());
      const said = this.make("p", { className: "said" }, box);
      return this.further(box, "section", (plot) => {
        if (!box.open) return;
        const [across, up] = [this.section.across, this.section.up].map((i) => all[i]), value = (one, s) => (one.angle ? wrapped(one.values(s)[0]) : one.values(s)[0]);
        const parts = this.runs.map((run) => run.crossings.filter((s) => s.t <= this.t).map((s) => [value(across, s), value(up, s)]));
        const count = parts.reduce((sum, part) => sum + part.length, 0), { paper, view } = this.chart(plot, parts.flat(), [across.name, up.name]);
        plot.canvas.setAttribute("aria-label", `${up.name} over ${across.name} at ${count} crossings`);
        said.textContent = count ? `${count} crossings.` : "No crossing yet: let the motion run, perhaps faster.";
        if (!view) return;
        // The newest one is larger.
        parts.forEach((part, r) => part.forEach((p, i) => { const [x, y] = view.map(p); disc(paper.pen, x, y, i === part.length - 1 ? 4 : 1.8, paper.colour(`path-${r % 7}`), paper.colour(i === part.length - 1 ? "paper" : `path-${r % 7}`)); }));
      });
    }

    // A plot of all choices, in which one is selected by a click.
    curve(parent) {
      const box = this.make("div", { className: "plot" }, parent), { labels, across, up, kinds } = this.data.curve, points = across.map((x, i) => [x, up[i]]), known = [...new Set(kinds)];
      const plot = this.further(box, "all choices", () => {
        const { paper, view } = this.chart(plot, points, labels), at = (i) => view.map(points[i]).slice(0, 2);
        plot.at = at;
        plot.canvas.setAttribute("aria-label", `${labels[1]} over ${labels[0]}; selected: ${this.data.starts[this.choice].name}`);
        paper.pen.strokeStyle = paper.colour("ground");
        line(paper.pen, points.map((_, i) => at(i)));
        points.forEach((_, i) => disc(paper.pen, ...at(i), i === this.choice ? 6.5 : 3, paper.colour(`path-${known.indexOf(kinds[i]) % 7}`), paper.colour(i === this.choice ? "ink" : "paper")));
        this.showLegend(plot.legend, known);
      });
      plot.canvas.addEventListener("click", (event) => {
        const frame = plot.canvas.getBoundingClientRect(), px = [event.clientX - frame.left, event.clientY - frame.top];
        const far = points.map((_, i) => distance(plot.at(i), px));
        this.choose(far.indexOf(Math.min(...far)));
      });
      return plot;
    }
  }

  const start = () => { for (const [root, model] of window.liveScenes || []) if (!root.live) root.live = new Live(root, model); };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})();
