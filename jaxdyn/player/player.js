// The player of motions: draws the data that `jaxdyn.player.export` wrote, with `canvas.js`.
// Every element with class "player" that holds a script of type "application/json" becomes one;
// the element's `player` has play(), pause(), seek(t), choose(i) and state().
"use strict";

(() => {
  const { KINDS, Paper, Turn, View, disc, fitted, line, themed } = JaxdynCanvas;
  const FLOOR = 1e-17; // lower end of the logarithmic axis of the relative change of the energy
  const PACES = [0.1, 0.25, 0.5, 1, 2, 4];
  const LONGEST = 12, SHORTEST = 4; // [s] duration of a motion at pace 1; 1 to 12 s in real time
  const SMALL = 1 / 8; // of the common box: a selected motion that is smaller has its own box
  const TURN = Math.PI / 24, ZOOM = 1.15; // per key press

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const doubles = (text) => new Float64Array(bytes(text));

  // (frames, places, dim) numbers that are stored as fractions of the motion's box in 16 bits.
  const places = (text, lo, hi) => {
    const shares = new Uint16Array(bytes(text)), dim = lo.length;
    return Float64Array.from(shares, (u, i) => lo[i % dim] + ((hi[i % dim] - lo[i % dim]) * u) / 65535);
  };

  // (frames, places, dim) positions, from the first frame by a linear map and a shift for each.
  function carried(first, text, dim) {
    const maps = new Float32Array(bytes(text)), size = dim * (dim + 1), n = first.length / dim;
    const found = new Float64Array((maps.length / size) * first.length);
    for (let f = 0, out = 0; f < maps.length; f += size)
      for (let i = 0; i < n; i++)
        for (let d = 0; d < dim; d++, out++) {
          found[out] = maps[f + dim * dim + d];
          for (let k = 0; k < dim; k++) found[out] += first[i * dim + k] * maps[f + k * dim + d];
        }
    return found;
  }

  function decode(motion) {
    const unpack = (text) => places(text, motion.lo, motion.hi);
    return {
      ...motion,
      ts: doubles(motion.ts),
      paths: unpack(motion.paths),
      shapes: motion.shapes.map((shape) => {
        const at = unpack(shape.at);
        return { ...shape, at: shape.moved ? carried(at, shape.moved, motion.lo.length) : at };
      }),
      energy: motion.energy && {
        ...motion.energy, ts: doubles(motion.energy.ts), change: doubles(motion.energy.change),
      },
    };
  }

  // The frame before a time, and the fraction of the way to the next one.
  function frame(ts, t) {
    let low = 0, high = ts.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (ts[middle] <= t) low = middle;
      else high = middle;
    }
    const span = ts[high] - ts[low];
    return [low, span ? Math.min(1, Math.max(0, (t - ts[low]) / span)) : 0];
  }

  // Positions (s, n, dim) interpolated between two frames; a single frame is constant.
  function at(data, n, dim, i, f, j) {
    if (data.length === n * dim) i = f = 0;
    const here = (i * n + j) * dim, next = f ? here + n * dim : here;
    return Array.from({ length: dim }, (_, d) => data[here + d] + f * (data[next + d] - data[here + d]));
  }

  class Player {
    constructor(root) {
      this.root = root;
      this.data = JSON.parse(root.querySelector("script[type='application/json']").textContent);
      this.motions = this.data.motions.map(decode);
      this.several = this.motions.length > 1 && !this.data.choose;
      this.shown = this.several ? this.motions : [this.motions[0]];
      this.turn = new Turn();
      this.pace = 1;
      this.trail = 0.25;
      this.playing = false;
      this.asked = false; // whether a reader has played or paused it: then it does not autoplay
      this.measure();
      this.box = this.boxed();
      this.t = this.begin;
      this.build();
      this.resize();
    }

    // The span of all motions shown, and how much of it passes in a second.
    measure() {
      this.begin = Math.min(...this.shown.map((m) => m.ts[0]));
      this.end = Math.max(...this.shown.map((m) => m.ts[m.ts.length - 1]));
      const span = this.end - this.begin || 1;
      this.rate = span >= 1 && span <= LONGEST ? 1 : span / (span > LONGEST ? LONGEST : SHORTEST);
    }

    // The box of the picture: the common one, so that motions can be compared, unless the selected
    // motion would be a dot in it.
    boxed() {
      const { box, choose, equal } = this.data, { lo, hi } = this.shown[0], [low, high] = box;
      const sizes = hi.map((x, d) => x - lo[d]), across = Math.max(...sizes);
      if (!choose || !equal || across > SMALL * Math.max(...high.map((x, d) => x - low[d]))) return box;
      const half = sizes.map((size) => 0.56 * Math.max(size, across / 4)); // as `drawing.panels.limits`
      const middle = lo.map((x, d) => (x + hi[d]) / 2);
      return [middle.map((x, d) => x - half[d]), middle.map((x, d) => x + half[d])];
    }

    build() {
      const make = (tag, set, parent = this.root) => parent.appendChild(Object.assign(document.createElement(tag), set));
      this.canvas = make("canvas", { className: "stage", tabIndex: 0 });
      this.canvas.setAttribute("role", "application");
      this.canvas.setAttribute("aria-label", `${this.root.dataset.label} ${this.keys()}`);
      const bar = make("div", { className: "controls" });
      this.button = make("button", { type: "button", textContent: "Play" }, bar);
      this.slider = make("input", { type: "range", min: 0, max: 1000, step: "any", value: 0 }, bar);
      this.slider.setAttribute("aria-label", "time");
      this.clock = make("span", { className: "clock" }, bar); // no live region: it changes all the time
      this.paces = this.select(make, bar, "speed", PACES.map((x) => [x, `${x} x`]), 1);
      this.trails = this.select(make, bar, "trail", [[0, "no trail"], [0.25, "trail"], [1, "whole path"]], 0.25);
      if (this.data.choose) this.chooser(make);
      this.names = make("p", { className: "legend" });
      this.stopped = make("p", { className: "said" });
      make("p", { className: "hint", textContent: `Keys: ${this.keys()}` });
      this.legend();
      if (this.motions.some((m) => m.energy)) {
        this.strip = make("canvas", { className: "energy" });
        this.strip.setAttribute("role", "img");
        this.strip.setAttribute("aria-label", "relative change of the energy over time");
        this.said = make("p", { className: "said" });
      }
      this.listen();
    }

    get turns() { return this.data.box[0].length === 3; }

    // The keys that work while the picture has the focus.
    keys() {
      if (this.turns) return "space plays, arrows or dragging rotate the view, Shift with left or right steps, [ and ] zoom.";
      return "space plays, the left and right arrows step, + and - change the speed.";
    }

    select(make, bar, label, choices, chosen) {
      const list = make("select", {}, bar);
      list.setAttribute("aria-label", label);
      for (const [value, text] of choices) make("option", { value, text, selected: value === chosen }, list);
      return list;
    }

    // A slider that selects one of the precomputed motions.
    chooser(make) {
      const row = make("label", { className: "chooser" });
      make("span", { textContent: this.data.choose }, row);
      const slider = make("input", { type: "range", min: 0, max: this.motions.length - 1, step: 1, value: 0 }, row);
      const value = make("output", { textContent: this.motions[0].name }, row);
      slider.setAttribute("aria-valuetext", this.motions[0].name);
      slider.addEventListener("input", () => {
        this.choose(+slider.value);
        value.textContent = this.shown[0].name;
        slider.setAttribute("aria-valuetext", this.shown[0].name);
      });
    }

    // The names of the motions, and why one stopped early.
    legend() {
      const named = this.several ? this.motions.map((m) => m.name) : this.shown[0].names;
      this.names.replaceChildren(...(named.length > 8 ? [] : named).map((name, i) => {
        const entry = Object.assign(document.createElement("span"), { textContent: name });
        entry.style.setProperty("--own", `var(--path-${i % 7})`);
        return entry;
      }));
      const early = this.shown.filter((m) => m.stopped);
      this.stopped.textContent = early.map((m) => `${this.several ? `${m.name}: ` : ""}stopped: ${m.stopped}`).join("; ");
    }

    listen() {
      this.button.addEventListener("click", () => this.toggle());
      this.slider.addEventListener("input", () => { this.pause(); this.seek(this.begin + (this.slider.value / 1000) * (this.end - this.begin)); });
      this.paces.addEventListener("change", () => { this.pace = +this.paces.value; });
      this.trails.addEventListener("change", () => { this.trail = +this.trails.value; this.draw(); });
      this.canvas.addEventListener("keydown", (event) => this.key(event));
      this.dragging();
      if (this.strip) this.strip.addEventListener("pointerdown", (event) => {
        const box = this.strip.getBoundingClientRect(), share = (event.clientX - box.left - 58) / (box.width - 72);
        this.pause();
        this.seek(this.begin + Math.min(1, Math.max(0, share)) * (this.end - this.begin));
      });
      new ResizeObserver(() => this.resize()).observe(this.root);
      themed(() => this.draw());
    }

    key(event) {
      const step = (this.end - this.begin) / 100;
      const keys = {
        " ": () => this.toggle(),
        ArrowLeft: () => { this.pause(); this.seek(this.t - step); },
        ArrowRight: () => { this.pause(); this.seek(this.t + step); },
        Home: () => this.seek(this.begin),
        End: () => this.seek(this.end),
        "+": () => this.faster(1),
        "-": () => this.faster(-1),
      };
      const turning = {
        ArrowLeft: () => this.turned(TURN, 0),
        ArrowRight: () => this.turned(-TURN, 0),
        ArrowUp: () => this.turned(0, -TURN),
        ArrowDown: () => this.turned(0, TURN),
        "]": () => this.zoomed(ZOOM),
        "[": () => this.zoomed(1 / ZOOM),
      };
      const does = (this.turns && !event.shiftKey && turning[event.key]) || keys[event.key];
      if (!does || event.altKey || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      does();
    }

    turned(azimuth, height) {
      this.turn.rotate(azimuth, height);
      this.draw();
    }

    zoomed(by) {
      this.turn.enlarge(by);
      this.draw();
    }

    faster(by) {
      const i = Math.min(PACES.length - 1, Math.max(0, PACES.indexOf(this.pace) + by));
      this.pace = PACES[i];
      this.paces.value = this.pace;
    }

    // Dragging rotates a picture in space; the wheel with Ctrl, or two fingers, zoom.
    dragging() {
      if (!this.turns) return;
      const held = new Map();
      this.canvas.classList.add("turns");
      this.canvas.addEventListener("pointerdown", (e) => { held.set(e.pointerId, e); this.canvas.setPointerCapture(e.pointerId); });
      for (const name of ["pointerup", "pointercancel"]) this.canvas.addEventListener(name, (e) => held.delete(e.pointerId));
      this.canvas.addEventListener("pointermove", (e) => {
        const last = held.get(e.pointerId);
        if (!last) return;
        if (held.size === 1) {
          this.turned((last.clientX - e.clientX) / 120, (e.clientY - last.clientY) / 120);
        } else {
          const [other] = [...held.values()].filter((p) => p.pointerId !== e.pointerId);
          const apart = (p) => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY);
          this.zoomed(apart(e) / Math.max(1, apart(last)));
        }
        held.set(e.pointerId, e);
      });
      this.canvas.addEventListener("wheel", (e) => {
        if (!e.ctrlKey) return;
        e.preventDefault();
        this.zoomed(Math.exp(-e.deltaY / 300));
      }, { passive: false });
    }

    toggle() { if (this.playing) this.pause(); else this.play(); }

    play() {
      this.asked = true;
      if (this.playing) return;
      if (this.t >= this.end) this.t = this.begin;
      this.playing = true;
      this.button.textContent = "Pause";
      let last = performance.now();
      const step = (now) => {
        // A hidden page is not drawn; the motion continues later from where it was.
        this.t += Math.min(0.1, Math.max(0, (now - last) / 1000)) * this.rate * this.pace;
        last = now;
        this.waiting = requestAnimationFrame(step);
        if (this.t >= this.end) { this.t = this.end; this.pause(); }
        this.draw();
      };
      this.waiting = requestAnimationFrame(step);
    }

    pause() {
      this.asked = true;
      this.playing = false;
      cancelAnimationFrame(this.waiting);
      this.button.textContent = "Play";
    }

    seek(t) {
      this.t = Math.min(this.end, Math.max(this.begin, t));
      this.draw();
    }

    choose(i) {
      this.shown = [this.motions[i]];
      this.measure();
      this.box = this.boxed();
      this.legend();
      this.seek(this.t);
    }

    // The current picture: the time, and the positions on the paths of each motion.
    state() {
      const points = this.shown.map((m) => {
        const [i, f] = frame(m.ts, this.t);
        return Array.from({ length: m.count }, (_, j) => at(m.paths, m.count, this.data.box[0].length, i, f, j));
      });
      return { t: this.t, playing: this.playing, points };
    }

    resize() {
      for (const canvas of [this.canvas, this.strip]) if (canvas) fitted(canvas);
      this.draw();
    }

    draw() {
      const view = new View(this.box, this.data.equal, this.canvas.clientWidth, this.canvas.clientHeight, this.turn);
      const paper = new Paper(this.root, this.canvas);
      paper.frame(view, this.data.labels);
      this.shown.forEach((motion, k) => this.motion(paper, view, motion, k));
      this.slider.value = (1000 * (this.t - this.begin)) / (this.end - this.begin || 1);
      const places = Math.max(0, 2 - Math.floor(Math.log10(this.end - this.begin || 1)));
      this.clock.textContent = `t = ${this.t.toFixed(places)}${this.data.second}`;
      this.slider.setAttribute("aria-valuetext", this.clock.textContent);
      if (this.strip) this.energies(new Paper(this.root, this.strip));
    }

    motion(paper, view, motion, k) {
      const [i, f] = frame(motion.ts, this.t), dim = view.dim, { pen } = paper;
      pen.save();
      paper.clip(view);
      const own = (j) => paper.colour(`path-${(this.several ? k : j) % 7}`);
      for (const ground of motion.grounds) paper.ground(ground.map((p) => view.map(p)));
      for (const kind of KINDS)
        for (const shape of motion.shapes.filter((s) => s.kind === kind)) this.shape(paper, view, shape, i, f, this.several && kind === "line" ? own(0) : null);
      this.tails(paper, view, motion, i, f, own);
      for (let j = 0; j < motion.count; j++) {
        const [x, y] = view.map(at(motion.paths, motion.count, dim, i, f, j));
        disc(pen, x, y, 5.5, own(j), paper.colour("paper"));
      }
      pen.restore();
    }

    // Paths up to now, fading, or whole paths.
    tails(paper, view, motion, i, f, own) {
      if (!this.trail) return;
      const whole = this.trail >= 1, since = this.t - this.trail * (this.end - this.begin);
      const first = whole ? 0 : frame(motion.ts, since)[0], last = whole ? motion.ts.length - 1 : i;
      for (let j = 0; j < motion.count; j++) {
        const corners = [];
        for (let s = first; s <= last; s++) corners.push(view.map(at(motion.paths, motion.count, view.dim, s, 0, j)));
        if (!whole) corners.push(view.map(at(motion.paths, motion.count, view.dim, i, f, j)));
        paper.tail(corners, own(j), whole);
      }
    }

    shape(paper, view, shape, i, f, colour) {
      const n = shape.lines * shape.corners;
      for (let m = 0; m < shape.lines; m++) {
        const corners = Array.from({ length: shape.corners }, (_, c) => view.map(at(shape.at, n, view.dim, i, f, m * shape.corners + c)));
        paper.stroke(view, shape.kind, corners, colour);
      }
    }

    // The relative change of the energy so far, on a logarithmic axis.
    energies(paper) {
      const { pen } = paper;
      const known = this.shown.filter((m) => m.energy);
      this.said.textContent = "";
      if (!known.length) return;
      const wide = this.strip.clientWidth - 72, high = this.strip.clientHeight - 24, left = 58, top = 6;
      const sizes = known.flatMap((m) => [...m.energy.change].map(Math.abs)).filter((x) => x > FLOOR);
      const upper = Math.ceil(Math.log10(Math.max(...sizes, 1e-15))), lower = Math.min(upper - 2, Math.max(-17, Math.floor(Math.log10(Math.min(...sizes, 1)))));
      const y = (change) => top + (high * (upper - Math.log10(Math.max(Math.abs(change), 10 ** lower)))) / (upper - lower);
      const x = (t) => left + (wide * (t - this.begin)) / (this.end - this.begin || 1);
      pen.textAlign = "right";
      pen.textBaseline = "middle";
      const stride = Math.ceil((upper - lower) / 4);
      for (let p = upper; p >= lower; p -= stride) {
        pen.strokeStyle = paper.colour("grid");
        pen.lineWidth = 1;
        line(pen, [[left, y(10 ** p)], [left + wide, y(10 ** p)]]);
        pen.fillStyle = paper.colour("faint");
        pen.fillText(`1e${p}`, left - 6, y(10 ** p));
      }
      known.forEach((m) => {
        pen.strokeStyle = paper.colour(`path-${(this.several ? this.shown.indexOf(m) : 0) % 7}`);
        pen.lineWidth = 1.4;
        line(pen, [...m.energy.ts].map((t, i) => [x(t), y(m.energy.change[i])]));
      });
      pen.strokeStyle = paper.colour("ink");
      line(pen, [[x(this.t), top], [x(this.t), top + high]]);
      this.said.textContent = known.map((m) => {
        const [i, f] = frame(m.energy.ts, this.t), c = m.energy.change, now = c[i] + f * ((c[i + 1] ?? c[i]) - c[i]);
        const name = this.several ? `${m.name}: ` : "";
        return `${name}energy ${(m.energy.start + now * m.energy.size).toPrecision(6)}${m.energy.unit}, relative change ${now.toExponential(1)}`;
      }).join("; ");
    }
  }

  // A motion starts when it scrolls into view, unless the reader prefers reduced motion or has
  // played or paused it before.
  const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const watch = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries)
      if (isIntersecting) { watch.unobserve(target); if (!target.player.asked) target.player.play(); }
  }, { threshold: 0.6 });
  const start = () => {
    for (const root of document.querySelectorAll(".player")) {
      if (root.player) continue;
      root.player = new Player(root);
      if (!calm && root.dataset.still === undefined) watch.observe(root);
    }
  };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})();
