// Animated miniatures of periodic orbits: closed paths of bodies, drawn on small canvases.
// The initial states are in `minis`, the program of a scene that `jaxdyn.player.model` wrote; the
// paths are computed by `motion.js` when their canvas becomes visible.
"use strict";

(() => {
  const COLOURS = 4; // of the player's paths, one for each body
  const SECONDS = 6; // of a period
  const FRAMES = 400; // of a period
  const paths = new Map();
  const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;

  // The places of each body over a period, about the mass centre, and how far they reach.
  function path(number) {
    if (paths.has(number)) return paths.get(number);
    const { start, span, parameters } = minis.data.starts[number], on = 2 ** minis.data.switches.length - 1;
    const motion = new JaxdynMotion(minis, parameters, on, 0, start, { span });
    const count = minis.data.marks.length, found = { x: [], y: [], reach: 0 };
    for (let j = 0; j < count; j++) { found.x.push([]); found.y.push([]); }
    for (let i = 0; i < FRAMES; i++) {
      const t = (i / FRAMES) * span;
      motion.to(t);
      const at = minis.places(t, motion.at(t), parameters);
      for (let j = 0; j < count; j++) {
        const [x, y] = at.slice(2 * j, 2 * j + 2);
        found.x[j].push(x);
        found.y[j].push(y);
        found.reach = Math.max(found.reach, Math.abs(x), Math.abs(y));
      }
    }
    paths.set(number, found);
    return found;
  }

  function draw(canvas, share) {
    const orbit = path(+canvas.dataset.mini);
    const ratio = window.devicePixelRatio || 1, side = canvas.clientWidth;
    if (canvas.width !== Math.round(side * ratio)) canvas.width = canvas.height = Math.round(side * ratio);
    const pen = canvas.getContext("2d"), count = orbit.x.length, frames = orbit.x[0].length;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, side, side);
    const style = getComputedStyle(canvas), colour = (j) => style.getPropertyValue(`--path-${j % COLOURS}`);
    const scale = (0.45 * side) / orbit.reach, place = (j, i) => [side / 2 + scale * orbit.x[j][i % frames], side / 2 - scale * orbit.y[j][i % frames]];
    for (let j = 0; j < count; j++) {
      pen.strokeStyle = colour(j);
      pen.globalAlpha = 0.45;
      pen.lineWidth = 1.2;
      pen.beginPath();
      for (let i = 0; i <= frames; i++) pen.lineTo(...place(j, i));
      pen.stroke();
    }
    pen.globalAlpha = 1;
    const at = share * frames, i = Math.floor(at), f = at - i;
    for (let j = 0; j < count; j++) {
      const [a, b] = [place(j, i), place(j, i + 1)];
      pen.fillStyle = colour(j);
      pen.beginPath();
      pen.arc(a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), 4, 0, 2 * Math.PI);
      pen.fill();
    }
  }

  const seen = new Set(), canvases = [...document.querySelectorAll("canvas[data-mini]")];
  const watch = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) if (isIntersecting) { seen.add(target); draw(target, share); } else seen.delete(target);
  });
  for (const canvas of canvases) watch.observe(canvas);
  // A button stops and starts all of them; for readers who prefer reduced motion they start stopped.
  const button = document.querySelector("[data-minis-play]");
  let playing = false, last = 0, share = 0;
  const step = (now) => {
    if (!playing) return;
    share = (share + Math.min(0.1, (now - last) / 1000) / SECONDS) % 1;
    last = now;
    for (const canvas of seen) draw(canvas, share);
    requestAnimationFrame(step);
  };
  const set = (on) => {
    playing = on;
    button.textContent = on ? "Pause all" : "Play all";
    last = performance.now();
    if (on) requestAnimationFrame(step);
  };
  button.hidden = false;
  button.addEventListener("click", () => set(!playing));
  set(!calm);
})();
