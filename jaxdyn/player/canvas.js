// Drawing on the pages of motions: a view of a plane or of space, axes, and the strokes of shapes.
// No dependencies.
"use strict";

var JaxdynCanvas = (() => {
  const COILS = 9, LEAD = 0.12; // of a drawn spring
  const HUNG = [[0, 0], [-0.6, 0.9], [-1, 0.9], [1, 0.9], [0.6, 0.9]];

  // The view of a box in space: rotated about the vertical, tilted, and enlarged.
  class Turn {
    constructor() {
      Object.assign(this, { azimuth: 0.6, height: 0.4, zoom: 1 });
    }
    rotate(azimuth, height) {
      this.azimuth += azimuth;
      this.height = Math.min(1.57, Math.max(-1.57, this.height + height));
    }
    enlarge(by) {
      this.zoom = Math.min(20, Math.max(0.1, this.zoom * by));
    }
  }

  // From space to the canvas [px]: axes with one scale or two, or a box that can be rotated.
  class View {
    constructor(box, equal, width, height, turn) {
      const [lo, hi] = this.box = box;
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
    // A position moved on the canvas by some pixels, at constant depth.
    moved(place, across, down) {
      if (this.dim === 2) return [place[0] + across / this.scales[0], place[1] - down / this.scales[1]];
      return place.map((x, d) => x + (across * this.rows[0][d] - down * this.rows[1][d]) / this.scale);
    }
  }

  // Round numbers between two ends, about `count` of them.
  function ticks(low, high, count) {
    const rough = (high - low) / Math.max(1, count), power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-12) + 1e-300; k++) found.push(k * step);
    const digits = -Math.floor(Math.log10(step) + 1e-9);
    return [found, found.every((x) => Math.abs(x) < 1e5) ? Math.max(0, digits) : digits];
  }

  // A tick with enough digits to distinguish it from its neighbours.
  const written = (x, digits) => {
    if (x === 0 || (Math.abs(x) < 1e5 && digits <= 6)) return x.toFixed(Math.min(6, Math.max(0, digits)));
    return x.toExponential(Math.min(15, Math.max(0, digits + Math.floor(Math.log10(Math.abs(x))))));
  };

  // From back to front.
  const KINDS = ["area", "pin", "spring", "dashpot", "line", "solid"];

  // A canvas with the colours of the element that it stands in, cleared.
  class Paper {
    constructor(root, canvas) {
      const ratio = canvas.width / Math.max(1, canvas.clientWidth), pen = canvas.getContext("2d");
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
      pen.lineJoin = pen.lineCap = "round";
      pen.font = "12px system-ui, sans-serif";
      this.pen = pen;
      this.style = getComputedStyle(root);
    }

    colour(name) { return this.style.getPropertyValue(`--${name}`).trim(); }

    axes(view, labels) {
      const { pen } = this;
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
      pen.fillText(labels[0], left + wide / 2, y0 + 38);
      pen.save();
      pen.translate(13, top + high / 2);
      pen.rotate(-Math.PI / 2);
      pen.fillText(labels[1], 0, 4);
      pen.restore();
    }

    // The edges of the box in space, and the names of its axes.
    cage(view, labels) {
      const { pen } = this;
      const [lo, hi] = view.box, ink = this.colour("ink");
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
          pen.fillText(labels[d], ...ends[1].slice(0, 2).map((x, k) => x + 0.05 * (x - view.centre[k])));
        }
    }

    // The axes of a plane or of space.
    frame(view, labels) {
      if (view.dim === 2) this.axes(view, labels);
      else this.cage(view, labels);
    }

    // From now on, drawing is clipped to the axes of a plane.
    clip(view) {
      if (!view.frame) return;
      this.pen.beginPath();
      this.pen.rect(...view.frame.map((x, d) => (d < 2 ? x - 8 : x + 16)));
      this.pen.clip();
    }

    ground(corners) {
      this.pen.strokeStyle = this.colour("ground");
      this.pen.lineWidth = 1.6;
      line(this.pen, corners);
    }

    // A path that ends at a body: fading, or whole.
    tail(corners, colour, whole) {
      const { pen } = this, parts = whole ? 1 : 12;
      pen.lineWidth = 2;
      pen.lineCap = "butt"; // round ends of faint parts would overlap and look like beads
      pen.strokeStyle = colour;
      for (let p = 0; p < parts; p++) {
        pen.globalAlpha = whole ? 0.7 : (p + 1) / parts;
        const [a, b] = [p, p + 1].map((q) => Math.round((q * (corners.length - 1)) / parts));
        line(pen, corners.slice(a, b + 1));
      }
      pen.globalAlpha = 1;
      pen.lineCap = "round";
    }

    // One line of a shape of a kind, from its corners on the canvas.
    stroke(view, kind, corners, colour) {
      const { pen } = this, solid = view.dim === 3;
      pen.strokeStyle = colour || this.colour("ink");
      pen.lineWidth = solid ? 1.5 : 2.2;
      const width = 0.022 * view.scale * Math.max(...view.box[0].map((x, d) => view.box[1][d] - x));
      if (kind === "spring") { pen.lineWidth = 1.3; line(pen, coiled(corners, width)); }
      else if (kind === "dashpot") { pen.lineWidth = 1.3; for (const part of dashpot(corners, width)) line(pen, part); }
      else if (kind === "pin") for (const corner of corners) this.pin(corner);
      else if (kind === "line") line(pen, corners);
      else closed(pen, corners, solid ? null : this.colour(kind === "area" ? "body" : "ink"));
    }

    arrow([x0, y0], [x1, y1], colour) {
      const { pen } = this, length = Math.hypot(x1 - x0, y1 - y0);
      if (!(length > 1)) return;
      const head = Math.min(8, 0.5 * length), [ux, uy] = [(x1 - x0) / length, (y1 - y0) / length];
      pen.strokeStyle = colour;
      pen.lineWidth = 2;
      line(pen, [[x0, y0], [x1 - 0.7 * head * ux, y1 - 0.7 * head * uy]]);
      this.head([x1, y1], [ux, uy], head, colour);
    }

    // The head of an arrow, with its tip at a position.
    head([x, y], [ux, uy], size, colour) {
      const { pen } = this;
      pen.fillStyle = colour;
      pen.beginPath();
      for (const [a, b] of [[0, 0], [-1, 0.45], [-1, -0.45]]) pen.lineTo(x + size * (a * ux - b * uy), y + size * (a * uy + b * ux));
      pen.fill();
    }

    // A moment in the plane of the picture: an arc around a point, relative to the longest one.
    moment([x, y], share, colour) {
      const { pen } = this, radius = 26, sweep = 1.5 * Math.PI * share, away = Math.sign(share);
      if (!(Math.abs(sweep) > 0.02)) return;
      const end = -sweep, head = Math.min(9, radius * Math.abs(sweep));
      pen.strokeStyle = colour;
      pen.lineWidth = 2;
      pen.beginPath();
      pen.arc(x, y, radius, 0, end + (0.7 * head * away) / radius, share > 0);
      pen.stroke();
      // Counterclockwise it goes up on the right; the head is rotated by half the angle it covers.
      const way = end + (0.5 * head * away) / radius;
      this.head([x + radius * Math.cos(end), y + radius * Math.sin(end)], [Math.sin(way) * away, -Math.cos(way) * away], head, colour);
    }

    pin([x, y]) {
      const { pen } = this;
      pen.fillStyle = this.colour("paper");
      pen.lineWidth = 1.5;
      pen.beginPath();
      for (const [dx, dy] of HUNG) pen.lineTo(x + 9 * dx, y - 9 * dy);
      pen.closePath();
      pen.fill();
      pen.stroke();
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

  // The pixels of a canvas; a point of the page may have several.
  function fitted(canvas) {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
  }

  // Draw again when the page becomes light or dark, by the system or by a switch of the page.
  const themed = (draw) => {
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
    new MutationObserver(draw).observe(document.documentElement, { attributeFilter: ["data-theme"] });
  };

  return { KINDS, Turn, View, Paper, disc, fitted, line, themed, ticks, written };
})();
