// The player of motions: draws what `jaxdyn.player.export` wrote on a canvas. No dependencies.
// Every element with class "player" that holds a script of type "application/json" becomes one;
// the element's `player` has play(), pause(), seek(t), choose(i) and state().
"use strict";

(() => {
  const FLOOR = 1e-17; // of the energy's relative change, on its logarithmic axis
  const PACES = [0.1, 0.25, 0.5, 1, 2, 4];
  const LONGEST = 12, SHORTEST = 4; // [s] a motion is shown in, at pace 1; 1 to 12 s in real time
  const SMALL = 1 / 8; // of the common box: a chosen motion that is smaller has a box of its own
  const TURN = Math.PI / 24, ZOOM = 1.15; // of a key
  const COILS = 9, LEAD = 0.12; // of a drawn spring
  const HUNG = [[0, 0], [-0.6, 0.9], [-1, 0.9], [1, 0.9], [0.6, 0.9]];

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const doubles = (text) => new Float64Array(bytes(text));

  // (frames, places, dim) numbers that are stored as shares of the motion's box in 16 bits.
  const places = (text, lo, hi) => {
    const shares = new Uint16Array(bytes(text)), dim = lo.length;
    return Float64Array.from(shares, (u, i) => lo[i % dim] + ((hi[i % dim] - lo[i % dim]) * u) / 65535);
  };

  // (frames, places, dim) places that a linear map and a shift take from the first frame to each.
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

  // The frame before a time, and the share of the way to the next one.
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

  // A place of frames (s, n, dim) between two frames; those of one frame stay where they are.
  function at(data, n, dim, i, f, j) {
    if (data.length === n * dim) i = f = 0;
    const here = (i * n + j) * dim, next = f ? here + n * dim : here;
    return Array.from({ length: dim }, (_, d) => data[here + d] + f * (data[next + d] - data[here + d]));
  }

  // From space to the canvas [px]: axes to one scale or two, or a box that can be turned.
  class View {
    constructor(box, equal, width, height, turn) {
      const [lo, hi] = box;
      this.dim = lo.length;
      this.middle = lo.map((x, d) => (x + hi[d]) / 2);
      if (this.dim === 3) {
        const across = Math.hypot(...lo.map((x, d) => hi[d] - x));
        this.scale = (turn.zoom * 1.05 * Math.min(width, height)) / across;
        const [ca, sa, ce, se] = [Math.cos(turn.azimuth), Math.sin(turn.azimuth), Math.cos(turn.height), Math.sin(turn.height)];
        this.rows = [[-sa, ca, 0], [-ca * se, -sa * se, ce], [ca * ce, sa * ce, se]];
        this.centre = [width / 2, height / 2];
        return;
      }
      const left = 58, right = 14, top = 12, below = 40;
      const wide = width - left - right, high = height - top - below;
      this.scales = [wide / (hi[0] - lo[0]), high / (hi[1] - lo[1])];
      if (equal) this.scales = this.scales.map(() => Math.min(...this.scales));
      this.scale = Math.min(...this.scales);
      this.centre = [left + wide / 2, top + high / 2];
      this.frame = [left, top, wide, high];
    }
    // [x, y, depth] on the canvas; depth is larger in front.
    map(place) {
      const off = place.map((x, d) => x - this.middle[d]);
      if (this.dim === 2)
        return [this.centre[0] + this.scales[0] * off[0], this.centre[1] - this.scales[1] * off[1], 0];
      const [x, y, z] = this.rows.map((row) => row.reduce((sum, r, d) => sum + r * off[d], 0));
      return [this.centre[0] + this.scale * x, this.centre[1] - this.scale * y, z];
    }
  }

  // Round numbers between two ends, about `count` of them.
  function ticks(low, high, count) {
    const rough = (high - low) / Math.max(1, count), power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-12) + 1e-300; k++) found.push(k * step);
    const digits = -Math.floor(Math.log10(step) + 1e-9);
    return [found, Math.abs(found[0] ?? 0) < 1e5 ? Math.max(0, digits) : digits];
  }

  // A tick with the digits that tell it from its neighbours.
  const written = (x, digits) => {
    if (x === 0 || (Math.abs(x) < 1e5 && digits <= 6)) return x.toFixed(Math.min(digits, 6));
    return x.toExponential(Math.min(15, Math.max(0, digits + Math.floor(Math.log10(Math.abs(x))))));
  };

  class Player {
    constructor(root) {
      this.root = root;
      this.data = JSON.parse(root.querySelector("script[type='application/json']").textContent);
      this.motions = this.data.motions.map(decode);
      this.several = this.motions.length > 1 && !this.data.choose;
      this.shown = this.several ? this.motions : [this.motions[0]];
      this.turn = { azimuth: 0.6, height: 0.4, zoom: 1 };
      this.pace = 1;
      this.trail = 0.25;
      this.playing = false;
      this.asked = false; // whether anyone has played or paused it: then it does not begin by itself
      this.measure();
      this.box = this.boxed();
      this.t = this.begin;
      this.build();
      this.resize();
    }

    // The span of all that is shown, and how much of it passes in a second.
    measure() {
      this.begin = Math.min(...this.shown.map((m) => m.ts[0]));
      this.end = Math.max(...this.shown.map((m) => m.ts[m.ts.length - 1]));
      const span = this.end - this.begin || 1;
      this.rate = span >= 1 && span <= LONGEST ? 1 : span / (span > LONGEST ? LONGEST : SHORTEST);
    }

    // The box of what is shown: the common one, in which chosen motions can be compared, unless
    // the chosen one would be a dot in it.
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

    // What the keys do once the picture is chosen by a click or by Tab.
    keys() {
      if (this.turns) return "space plays, arrows or dragging turn it, Shift with the left and right ones steps, [ and ] zoom.";
      return "space plays, the left and right arrows step, + and - change the speed.";
    }

    select(make, bar, label, choices, chosen) {
      const list = make("select", {}, bar);
      list.setAttribute("aria-label", label);
      for (const [value, text] of choices) make("option", { value, text, selected: value === chosen }, list);
      return list;
    }

    // A slider that chooses one of the precomputed motions.
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

    // The names of what is shown, and why a motion stopped early.
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
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
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
      this.turn.azimuth += azimuth;
      this.turn.height = Math.min(1.57, Math.max(-1.57, this.turn.height + height));
      this.draw();
    }

    zoomed(by) {
      this.turn.zoom = Math.min(20, Math.max(0.1, this.turn.zoom * by));
      this.draw();
    }

    faster(by) {
      const i = Math.min(PACES.length - 1, Math.max(0, PACES.indexOf(this.pace) + by));
      this.pace = PACES[i];
      this.paces.value = this.pace;
    }

    // Dragging turns a picture in space, the wheel with Ctrl or two fingers enlarge it.
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
        // A hidden page is not drawn: the motion goes on where it was.
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

    // What is shown now: the time, and the places of the paths of each motion.
    state() {
      const points = this.shown.map((m) => {
        const [i, f] = frame(m.ts, this.t);
        return Array.from({ length: m.count }, (_, j) => at(m.paths, m.count, this.data.box[0].length, i, f, j));
      });
      return { t: this.t, playing: this.playing, points };
    }

    resize() {
      for (const canvas of [this.canvas, this.strip]) {
        if (!canvas) continue;
        const ratio = window.devicePixelRatio || 1;
        canvas.width = Math.round(canvas.clientWidth * ratio);
        canvas.height = Math.round(canvas.clientHeight * ratio);
      }
      this.draw();
    }

    pen(canvas) {
      const ratio = canvas.width / Math.max(1, canvas.clientWidth), pen = canvas.getContext("2d");
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
      pen.lineJoin = pen.lineCap = "round";
      pen.font = "12px system-ui, sans-serif";
      return pen;
    }

    colour(name) { return this.style.getPropertyValue(`--${name}`).trim(); }

    draw() {
      this.style = getComputedStyle(this.root);
      const view = new View(this.box, this.data.equal, this.canvas.clientWidth, this.canvas.clientHeight, this.turn);
      const pen = this.pen(this.canvas);
      if (view.dim === 2) this.axes(pen, view);
      else this.cage(pen, view);
      this.shown.forEach((motion, k) => this.motion(pen, view, motion, k));
      this.slider.value = (1000 * (this.t - this.begin)) / (this.end - this.begin || 1);
      const places = Math.max(0, 2 - Math.floor(Math.log10(this.end - this.begin || 1)));
      this.clock.textContent = `t = ${this.t.toFixed(places)}${this.data.second}`;
      this.slider.setAttribute("aria-valuetext", this.clock.textContent);
      if (this.strip) this.energies(this.pen(this.strip));
    }

    axes(pen, view) {
      const [left, top, wide, high] = view.frame, [x0, y0] = [left, top + high];
      const ends = (d, from, to) => [from, to].map((px) => view.middle[d] + ((px - view.centre[d]) / view.scales[d]) * (d ? -1 : 1));
      pen.lineWidth = 1;
      for (const d of [0, 1]) {
        const [low, high_] = d ? ends(1, y0, top) : ends(0, left, left + wide);
        const [marks, digits] = ticks(low, high_, d ? high / 60 : wide / 80);
        for (const mark of marks) {
          const place = [...view.middle];
          place[d] = mark;
          const px = view.map(place)[d];
          pen.strokeStyle = this.colour("grid");
          line(pen, d ? [[left, px], [left + wide, px]] : [[px, top], [px, y0]]);
          pen.fillStyle = this.colour("faint");
          pen.textAlign = d ? "right" : "center";
          pen.textBaseline = d ? "middle" : "top";
          pen.fillText(written(mark, digits), d ? left - 6 : px, d ? px : y0 + 5);
        }
      }
      pen.fillStyle = this.colour("ink");
      pen.textAlign = "center";
      pen.textBaseline = "bottom";
      pen.fillText(this.data.labels[0], left + wide / 2, y0 + 38);
      pen.save();
      pen.translate(13, top + high / 2);
      pen.rotate(-Math.PI / 2);
      pen.fillText(this.data.labels[1], 0, 4);
      pen.restore();
    }

    // The edges of the box in space, and the names of its axes.
    cage(pen, view) {
      const [lo, hi] = this.box, ink = this.colour("ink");
      pen.lineWidth = 1;
      for (let corner = 0; corner < 8; corner++)
        for (let d = 0; d < 3; d++) {
          if (corner & (1 << d)) continue;
          const ends = [corner, corner | (1 << d)].map((c) => view.map(lo.map((x, k) => (c & (1 << k) ? hi[k] : x))));
          pen.strokeStyle = this.colour(corner === 0 ? "faint" : "grid");
          line(pen, ends);
          if (corner !== 0) continue;
          pen.fillStyle = ink;
          pen.textAlign = "center";
          pen.textBaseline = "middle";
          pen.fillText(this.data.labels[d], ...ends[1].slice(0, 2).map((x, k) => x + 0.05 * (x - view.centre[k])));
        }
    }

    motion(pen, view, motion, k) {
      const [i, f] = frame(motion.ts, this.t), dim = view.dim;
      pen.save();
      if (view.frame) { pen.beginPath(); pen.rect(...view.frame.map((x, d) => (d < 2 ? x - 8 : x + 16))); pen.clip(); }
      const own = (j) => this.colour(`path-${(this.several ? k : j) % 7}`);
      for (const ground of motion.grounds) {
        pen.strokeStyle = this.colour("ground");
        pen.lineWidth = 1.6;
        line(pen, ground.map((p) => view.map(p)));
      }
      for (const kind of ["area", "pin", "spring", "dashpot", "line", "solid"])
        for (const shape of motion.shapes.filter((s) => s.kind === kind)) this.shape(pen, view, shape, i, f, this.several && kind === "line" ? own(0) : null);
      this.tails(pen, view, motion, i, f, own);
      for (let j = 0; j < motion.count; j++) {
        const [x, y] = view.map(at(motion.paths, motion.count, dim, i, f, j));
        disc(pen, x, y, 5.5, own(j), this.colour("paper"));
      }
      pen.restore();
    }

    // Paths up to now, fading; the whole path if so chosen.
    tails(pen, view, motion, i, f, own) {
      if (!this.trail) return;
      const since = this.t - this.trail * (this.end - this.begin);
      const first = this.trail >= 1 ? 0 : frame(motion.ts, since)[0], last = this.trail >= 1 ? motion.ts.length - 1 : i;
      pen.lineWidth = 2;
      pen.lineCap = "butt"; // round ends of faint parts would overlap and show as beads
      for (let j = 0; j < motion.count; j++) {
        pen.strokeStyle = own(j);
        const corners = [];
        for (let s = first; s <= last; s++) corners.push(view.map(at(motion.paths, motion.count, view.dim, s, 0, j)));
        if (this.trail < 1) corners.push(view.map(at(motion.paths, motion.count, view.dim, i, f, j)));
        const parts = this.trail >= 1 ? 1 : 12;
        for (let p = 0; p < parts; p++) {
          pen.globalAlpha = this.trail >= 1 ? 0.7 : (p + 1) / parts;
          const [a, b] = [p, p + 1].map((q) => Math.round((q * (corners.length - 1)) / parts));
          line(pen, corners.slice(a, b + 1));
        }
      }
      pen.globalAlpha = 1;
      pen.lineCap = "round";
    }

    shape(pen, view, shape, i, f, colour) {
      const n = shape.lines * shape.corners, ink = this.colour("ink");
      for (let m = 0; m < shape.lines; m++) {
        const corners = Array.from({ length: shape.corners }, (_, c) => view.map(at(shape.at, n, view.dim, i, f, m * shape.corners + c)));
        pen.strokeStyle = colour || ink;
        pen.lineWidth = view.dim === 3 ? 1.5 : 2.2;
        const width = 0.022 * view.scale * Math.max(...this.box[0].map((x, d) => this.box[1][d] - x));
        if (shape.kind === "spring") { pen.lineWidth = 1.3; line(pen, coiled(corners, width)); }
        else if (shape.kind === "dashpot") { pen.lineWidth = 1.3; for (const part of dashpot(corners, width)) line(pen, part); }
        else if (shape.kind === "pin") for (const corner of corners) this.pin(pen, corner);
        else if (shape.kind === "line") line(pen, corners);
        else closed(pen, corners, view.dim === 3 ? null : this.colour(shape.kind === "area" ? "body" : "ink"));
      }
    }

    pin(pen, [x, y]) {
      pen.fillStyle = this.colour("paper");
      pen.lineWidth = 1.5;
      pen.beginPath();
      for (const [dx, dy] of HUNG) pen.lineTo(x + 9 * dx, y - 9 * dy);
      pen.closePath();
      pen.fill();
      pen.stroke();
    }

    // The relative change of the energy so far, on a logarithmic axis.
    energies(pen) {
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
        pen.strokeStyle = this.colour("grid");
        pen.lineWidth = 1;
        line(pen, [[left, y(10 ** p)], [left + wide, y(10 ** p)]]);
        pen.fillStyle = this.colour("faint");
        pen.fillText(`1e${p}`, left - 6, y(10 ** p));
      }
      known.forEach((m) => {
        pen.strokeStyle = this.colour(`path-${(this.several ? this.shown.indexOf(m) : 0) % 7}`);
        pen.lineWidth = 1.4;
        line(pen, [...m.energy.ts].map((t, i) => [x(t), y(m.energy.change[i])]));
      });
      pen.strokeStyle = this.colour("ink");
      line(pen, [[x(this.t), top], [x(this.t), top + high]]);
      this.said.textContent = known.map((m) => {
        const [i, f] = frame(m.energy.ts, this.t), c = m.energy.change, now = c[i] + f * ((c[i + 1] ?? c[i]) - c[i]);
        const name = this.several ? `${m.name}: ` : "";
        return `${name}energy ${(m.energy.start + now * m.energy.size).toPrecision(6)}${m.energy.unit}, changed by ${now.toExponential(1)} of its size`;
      }).join("; ");
    }
  }

  function line(pen, corners) {
    pen.beginPath();
    for (const [x, y] of corners) pen.lineTo(x, y);
    pen.stroke();
  }

  function closed(pen, corners, fill) {
    pen.beginPath();
    for (const [x, y] of corners) pen.lineTo(x, y);
    pen.closePath();
    if (fill) { pen.fillStyle = fill; pen.fill(); }
    pen.stroke();
  }

  function disc(pen, x, y, radius, fill, edge) {
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fillStyle = fill;
    pen.fill();
    pen.lineWidth = 1.5;
    pen.strokeStyle = edge;
    pen.stroke();
  }

  // A direction on the canvas, and the one to its left, of length `width`.
  const beside = ([a, b], width) => {
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]], length = Math.hypot(dx, dy) || 1;
    return [(-dy / length) * width, (dx / length) * width];
  };

  function coiled(ends, width) {
    const [a, b] = ends, [sx, sy] = beside(ends, width), corners = [a];
    for (let i = 0; i <= 2 * COILS; i++) {
      const share = LEAD + ((1 - 2 * LEAD) * i) / (2 * COILS), side = i === 0 || i === 2 * COILS ? 0 : i % 2 ? 1 : -1;
      corners.push([a[0] + share * (b[0] - a[0]) + side * sx, a[1] + share * (b[1] - a[1]) + side * sy]);
    }
    return [...corners, b];
  }

  function dashpot(ends, width) {
    const [sx, sy] = beside(ends, width), [a, b] = ends;
    const on = (share, side) => [a[0] + share * (b[0] - a[0]) + side * sx, a[1] + share * (b[1] - a[1]) + side * sy];
    return [
      [a, on(0, 2.5), on(0.4, 2.5)], [on(0.5, 2.5), on(1, 2.5), b],
      [on(0.62, 3.5), on(0.4, 3.5), on(0.4, 1.5), on(0.62, 1.5)], [on(0.5, 3.5), on(0.5, 1.5)],
    ];
  }

  // A motion begins to move when it comes into sight, unless the reader prefers stillness or has
  // played or paused it before: a page is in sight only some time after it was read.
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
