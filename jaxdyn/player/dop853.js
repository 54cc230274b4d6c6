// An integrator for smooth rates: the pair of order 8 of Dormand and Prince with the error
// estimates of orders 5 and 3 and the dense output of order 7 of Hairer, Norsett and Wanner (Solving
// Ordinary Differential Equations I, section II.5; the coefficients are those of their DOP853).
// No dependencies; it runs on a page and in Node.
"use strict";

var Dop853 = (() => {
  // Nodes; for each stage, the 13th of which is the rate after the step, its [stage, weight].
  const C = [0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333, 0.25, 0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0, 1.0, 0.1, 0.2, 0.7777777777777778];
  const A = [
    [],
    [[0, 0.05260015195876773]],
    [[0, 0.0197250569845379], [1, 0.0591751709536137]],
    [[0, 0.02958758547680685], [2, 0.08876275643042054]],
    [[0, 0.2413651341592667], [2, -0.8845494793282861], [3, 0.924834003261792]],
    [[0, 0.037037037037037035], [3, 0.17082860872947386], [4, 0.12546768756682242]],
    [[0, 0.037109375], [3, 0.17025221101954405], [4, 0.06021653898045596], [5, -0.017578125]],
    [[0, 0.03709200011850479], [3, 0.17038392571223998], [4, 0.10726203044637328], [5, -0.015319437748624402], [6, 0.008273789163814023]],
    [[0, 0.6241109587160757], [3, -3.3608926294469414], [4, -0.868219346841726], [5, 27.59209969944671], [6, 20.154067550477894], [7, -43.48988418106996]],
    [[0, 0.47766253643826434], [3, -2.4881146199716677], [4, -0.590290826836843], [5, 21.230051448181193], [6, 15.279233632882423], [7, -33.28821096898486], [8, -0.020331201708508627]],
    [[0, -0.9371424300859873], [3, 5.186372428844064], [4, 1.0914373489967295], [5, -8.149787010746927], [6, -18.52006565999696], [7, 22.739487099350505], [8, 2.4936055526796523], [9, -3.0467644718982196]],
    [[0, 2.273310147516538], [3, -10.53449546673725], [4, -2.0008720582248625], [5, -17.9589318631188], [6, 27.94888452941996], [7, -2.8589982771350235], [8, -8.87285693353063], [9, 12.360567175794303], [10, 0.6433927460157636]],
    [[0, 0.054293734116568765], [5, 4.450312892752409], [6, 1.8915178993145003], [7, -5.801203960010585], [8, 0.3111643669578199], [9, -0.1521609496625161], [10, 0.20136540080403034], [11, 0.04471061572777259]],
    [[0, 0.056167502283047954], [6, 0.25350021021662483], [7, -0.2462390374708025], [8, -0.12419142326381637], [9, 0.15329179827876568], [10, 0.00820105229563469], [11, 0.007567897660545699], [12, -0.008298]],
    [[0, 0.03183464816350214], [5, 0.028300909672366776], [6, 0.053541988307438566], [7, -0.05492374857139099], [10, -0.00010834732869724932], [11, 0.0003825710908356584], [12, -0.00034046500868740456], [13, 0.1413124436746325]],
    [[0, -0.42889630158379194], [5, -4.697621415361164], [6, 7.683421196062599], [7, 4.06898981839711], [8, 0.3567271874552811], [12, -0.0013990241651590145], [13, 2.9475147891527724], [14, -9.15095847217987]],
  ];
  const E3 = [[0, -0.18980075407240762], [5, 4.450312892752409], [6, 1.8915178993145003], [7, -5.801203960010585], [8, -0.4226823213237919], [9, -0.1521609496625161], [10, 0.20136540080403034], [11, 0.02265179219836082]], E5 = [[0, 0.01312004499419488], [5, -1.2251564463762044], [6, -0.4957589496572502], [7, 1.6643771824549864], [8, -0.35032884874997366], [9, 0.3341791187130175], [10, 0.08192320648511571], [11, -0.022355307863886294]];
  const D = [
    [[0, -8.428938276109013], [5, 0.5667149535193777], [6, -3.0689499459498917], [7, 2.38466765651207], [8, 2.117034582445028], [9, -0.871391583777973], [10, 2.2404374302607883], [11, 0.6315787787694688], [12, -0.08899033645133331], [13, 18.148505520854727], [14, -9.194632392478356], [15, -4.436036387594894]],
    [[0, 10.427508642579134], [5, 242.28349177525817], [6, 165.20045171727028], [7, -374.5467547226902], [8, -22.113666853125306], [9, 7.733432668472264], [10, -30.674084731089398], [11, -9.332130526430229], [12, 15.697238121770845], [13, -31.139403219565178], [14, -9.35292435884448], [15, 35.81684148639408]],
    [[0, 19.985053242002433], [5, -387.0373087493518], [6, -189.17813819516758], [7, 527.8081592054236], [8, -11.57390253995963], [9, 6.8812326946963], [10, -1.0006050966910838], [11, 0.7777137798053443], [12, -2.778205752353508], [13, -60.19669523126412], [14, 84.32040550667716], [15, 11.99229113618279]],
    [[0, -25.69393346270375], [5, -154.18974869023643], [6, -231.5293791760455], [7, 357.6391179106141], [8, 93.40532418362432], [9, -37.45832313645163], [10, 104.0996495089623], [11, 29.8402934266605], [12, -43.53345659001114], [13, 96.32455395918828], [14, -39.17726167561544], [15, -149.72683625798564]],
  ];
  const STAGES = 12, ALL = 16;
  const SAFETY = 0.9, LEAST = 1 / 3, MOST = 6; // for the change of the step size
  const FIRST = 0.01; // the first step, relative to the time in which the state changes by its size
  const SHORTEST = 1e-15; // of the span: shorter steps mean that a singularity is near
  const LONGEST = 1 / 50; // of the span: a longer step could pass over a pulse
  const SOON = 1e-3; // of the span: an entry that is zero gets the size that it reaches in this time
  // At a jump of the rate no step is short enough, so one is taken whatever its error. Where the rate
  // jumps again and again, as in dry friction that sticks, longer steps (parts of the span) are taken
  // after so many tiny ones, each of which was cut so many times. In a close encounter steps are tiny
  // too, but their length was predicted. Where the rate has grown so many times, a singularity is
  // near, and no such step is taken.
  const OVER = 1e-12, TINY = 1e-9, CUTS = 4, PATIENCE = 7, CRAWL = 1e-5, CRAWLS = 200, STEEP = 100;
  const LOOKS = 8; // times within a step at which conditions on time are evaluated
  const MOST_PASSED = 100; // changes of conditions at successive numbers; more are rounding

  class Dop853 {
    // The motion of dy/dt = rate(t, y) from y at t.
    // span: the time scale of the motion, with either sign; steps are fractions of it.
    // groups: {of: (k) the kind of each entry, most: (k) the largest size of it or null}; entries
    //   of a kind are compared with the largest of them. project: (t, y) onto constraints, or null.
    // rough: whether the rate has conditions. outcomes: (t) those of its conditions on time alone, or
    //   null: a step ends where one changes.
    constructor(rate, t, y, { span = 1, groups = null, project = null, rough = false, outcomes = null, rtol = 1e-13 } = {}) {
      const k = y.length;
      this.rate = rate;
      this.project = project;
      this.outcomes = outcomes;
      this.rtol = rtol;
      this.span = Math.abs(span) || 1;
      this.of = groups ? groups.of : y.map((_, i) => i);
      this.most = groups ? groups.most.map((m) => m ?? Infinity) : y.map(() => Infinity);
      this.sizes = new Array(k).fill(0);
      this.t = this.before = t;
      this.y = this.from = Array.from(y);
      this.stages = new Array(ALL);
      this.dense = null;
      this.failed = "";
      this.rough = rough;
      this.speeds = new Array(k).fill(0); // of each kind, at steps that are not tiny
      this.jumps = this.crawls = 0;
      this.crawled = null; // the time since which it has crawled
      this.steps = this.rejected = 0;
      this.now = rate(t, this.y);
      this.grow(this.y);
      this.grow(this.now.map((x) => SOON * this.span * x)); // an entry near zero by chance soon is not
      this.quicken();
      this.h = this.first();
      if (!this.now.every(Number.isFinite)) this.failed = "not a number";
    }

    // The sizes of the kinds of entries so far.
    grow(y) {
      for (let i = 0; i < y.length; i++) this.sizes[this.of[i]] = Math.max(this.sizes[this.of[i]], Math.abs(y[i]));
    }

    // The rates of the kinds of entries so far.
    quicken() {
      for (let i = 0; i < this.now.length; i++) this.speeds[this.of[i]] = Math.max(this.speeds[this.of[i]], Math.abs(this.now[i]));
    }

    first() {
      let h = LONGEST * this.span;
      for (let i = 0; i < this.y.length; i++) {
        const size = Math.min(this.sizes[this.of[i]], this.most[i]), speed = Math.abs(this.now[i]);
        if (size && speed) h = Math.min(h, (FIRST * size) / speed);
      }
      return h;
    }

    // The last number before a condition on time changes, and the first one after it; null if none
    // changes on the way to `end`.
    change(end) {
      if (!this.outcomes) return null;
      const given = this.outcomes(this.t), same = (t) => this.outcomes(t).every((x, i) => x === given[i]);
      let low = this.t, high = null;
      for (let n = 1; n <= LOOKS && high === null; n++) {
        const t = n === LOOKS ? end : this.t + (n / LOOKS) * (end - this.t);
        if (same(t)) low = t;
        else high = t;
      }
      if (high === null) return null;
      for (;;) {
        const middle = low + (high - low) / 2;
        if (middle === low || middle === high) return [low, high];
        if (same(middle)) low = middle;
        else high = middle;
      }
    }

    // Go on at a time, the next number after the current one.
    pass(t) {
      this.t = t;
      this.now = this.rate(t, this.y);
    }

    // A weighted sum of stages, for one entry.
    static sum(weights, stages, i) {
      let sum = 0;
      for (const [s, a] of weights) sum += a * stages[s][i];
      return sum;
    }

    // One step, at most to `end`; false if it failed.
    step(end) {
      if (this.failed) return false;
      const { y, stages } = this, k = y.length, way = end < this.t ? -1 : 1;
      let h = Math.min(this.h, LONGEST * this.span), cuts = 0;
      const far = Math.max(h, CRAWL * this.span), ahead = () => this.change(far >= Math.abs(end - this.t) ? end : this.t + way * far);
      let change = ahead();
      for (let n = 0; change?.[0] === this.t && n < MOST_PASSED; n++, change = ahead()) this.pass(change[1]);
      const { t } = this;
      if (change && change[0] !== t) end = change[0];
      let blind = false; // whether the step is accepted whatever its error
      if (this.jumps >= PATIENCE) this.crawl();
      for (;;) {
        if (this.crawls || h < SHORTEST * this.span) {
          if (!this.rough || this.steep()) { this.failed = "too small steps"; return false; }
          blind = true;
          h = (this.crawls ? CRAWL : OVER) * this.span;
        }
        const last = h >= Math.abs(end - t), dt = last ? end - t : way * h;
        stages[0] = this.now;
        let next = null;
        for (let s = 1; s <= STAGES; s++) {
          const at = new Array(k);
          for (let i = 0; i < k; i++) at[i] = y[i] + dt * Dop853.sum(A[s], stages, i);
          if (s === STAGES) next = at;
          else stages[s] = this.rate(t + C[s] * dt, at);
        }
        const error = this.error(next, dt);
        if (error <= 1 || (blind && Number.isFinite(error))) {
          const there = last ? end : t + dt;
          stages[STAGES] = this.rate(there, next);
          if (stages[STAGES].every(Number.isFinite)) {
            this.accept(there, next, dt, cuts);
            if (last && change) this.pass(change[1]);
            if (this.crawls) this.crawls--;
            const factor = error ? SAFETY * error ** (-1 / 8) : MOST;
            // A step that was cut short says nothing about longer ones.
            const proposed = Math.abs(dt) * Math.min(cuts ? 1 : MOST, Math.max(LEAST, factor));
            this.h = last ? Math.max(proposed, Math.min(h, this.h)) : proposed;
            return true;
          }
        }
        this.rejected++;
        cuts++;
        if (blind) { this.failed = "not a number"; return false; }
        h = Math.abs(dt) * (error > 1 ? Math.max(LEAST, SAFETY * error ** (-1 / 8)) : LEAST); // also for NaN
      }
    }

    // The error estimate of a step, relative to the tolerance.
    error(next, dt) {
      const { y, stages, rtol } = this, k = y.length;
      let fifth = 0, third = 0;
      for (let i = 0; i < k; i++) {
        const entry = Math.max(Math.abs(y[i]), Math.abs(next[i])), most = this.most[i];
        const size = this.sizes[this.of[i]] || SOON * this.span * Math.max(...stages.slice(0, STAGES).map((k) => Math.abs(k[i])));
        const scale = rtol * (Math.min(entry, most) + Math.min(Math.max(size, entry), most) / 4);
        const e5 = Dop853.sum(E5, stages, i), e3 = Dop853.sum(E3, stages, i);
        if (e5) fifth += (e5 / scale) ** 2;
        if (e3) third += (e3 / scale) ** 2;
      }
      const size = fifth + 0.01 * third;
      return size ? (Math.abs(dt) * fifth) / Math.sqrt(size * k) : size;
    }

    // Whether the rate has become far larger than it was.
    steep() {
      return this.now.some((v, i) => Math.abs(v) > STEEP * this.speeds[this.of[i]]);
    }

    // Accept some steps whatever their error.
    crawl() {
      this.crawls = CRAWLS;
      this.jumps = 0;
      this.crawled ??= this.t;
    }

    accept(t, y, dt, cuts) {
      if (Math.abs(dt) > TINY * this.span) {
        this.quicken();
        this.jumps = 0;
      } else if (cuts >= CUTS) this.jumps++;
      this.before = this.t;
      this.from = this.y;
      this.dt = dt;
      this.until = y; // before projection, since the dense output is that of the step
      this.dense = null;
      this.steps++;
      this.t = t;
      this.y = this.project ? Array.from(this.project(t, y)) : y;
      this.now = this.project ? this.rate(t, this.y) : this.stages[STAGES];
      this.grow(this.y);
    }

    // The state at a time within the last step.
    at(t) {
      if (t === this.t || this.before === this.t) return this.y;
      const { from, until, dt, stages } = this, k = from.length;
      if (!this.dense) {
        for (let s = STAGES + 1; s < ALL; s++) {
          const at = new Array(k);
          for (let i = 0; i < k; i++) at[i] = from[i] + dt * Dop853.sum(A[s], stages, i);
          stages[s] = this.rate(this.before + C[s] * dt, at);
        }
        this.dense = from.map((y, i) => {
          const change = until[i] - y, [first, last] = [dt * stages[0][i], dt * stages[STAGES][i]];
          return [change, first - change, 2 * change - first - last, ...D.map((row) => dt * Dop853.sum(row, stages, i))];
        });
      }
      const x = (t - this.before) / dt;
      return this.dense.map((f, i) => {
        let sum = 0;
        for (let j = f.length - 1; j >= 0; j--) sum = (sum + f[j]) * (j % 2 ? 1 - x : x);
        return from[i] + sum;
      });
    }

    // Go to a time, or as far as `most` steps reach; returns the state there, or null on failure.
    to(t, most = Infinity) {
      for (let n = 0; this.t < t && n < most; n++) if (!this.step(t)) return null;
      return this.y;
    }
  }
  return Dop853;
})();
if (typeof module !== "undefined") module.exports = { Dop853 };
