// The loops of views that move: a play button, and poses asked for, drawn and read.
import { el } from "./dom.js";
import { listen, tab } from "./server.js";

// ms of a turn.
const TURN = 4000;
// ms between two readings: figures that change oftener cannot be read.
const READABLE = 110;
// Frames of which times are kept.
const FRAMES = 240;

// The angle of a turn after so many ms.
export const angleAt = (elapsed) => (elapsed / TURN) * 2 * Math.PI;

// A button that plays something until it is pressed again, or until it ends.
export class Playing {
  // `begin` returns what shows the state after so many ms, or nothing where there is nothing to play.
  constructor(begin, ended = () => {}) {
    Object.assign(this, { begin, ended });
    this.button = el("button", { "aria-pressed": "false", onclick: () => (this.on ? this.stop() : this.start()) }, "Play");
  }
  get on() { return Boolean(this.frame); }
  start() {
    const show = this.begin(), start = performance.now();
    if (!show) return;
    this.label("Pause", true);
    const step = () => {
      this.frame = requestAnimationFrame(step);
      show(performance.now() - start);
    };
    this.frame = requestAnimationFrame(step);
  }
  stop() {
    if (!this.on) return;
    cancelAnimationFrame(this.frame);
    this.frame = null;
    this.label("Play", false);
    this.ended();
  }
  label(words, on) { this.button.textContent = words; this.button.setAttribute("aria-pressed", String(on)); }
}

// A view of poses: it has `request()`, `answer(answer)`, `draw()` and `readings()`.
export class PoseView {
  constructor(studio) { Object.assign(this, { studio, times: [], costs: [] }); }
  hide() { this.playing.stop(); }
  say(words, beyond) { this.trust.textContent = words; this.trust.classList.toggle("beyond", beyond); }

  // The newest request goes out as soon as the last one is answered.
  want() {
    this.wanted = true;
    if (!this.asking) this.ask();
  }
  async ask() {
    const request = this.request();
    if (!request) return;
    this.wanted = false;
    this.asking = true;
    try {
      await listen("/api/motion", { tab, edits: [], name: this.studio.name, ...request }, (answer) => this.answer(answer));
    } catch (error) { this.say(error.message, true); }
    this.asking = false;
    if (this.wanted) this.ask();
    else this.idle?.();
  }
  // What arrives is drawn in the next frame; while it is painted the next pose is computed.
  inFrame(show) { this.frame ??= requestAnimationFrame(() => { this.frame = null; show(); }); }
  // Draws and reads, and keeps the time of the frame and the ms that it took.
  paint() {
    const before = performance.now();
    if (this.stage) this.draw();
    this.tell();
    this.times.push(before);
    this.costs.push(performance.now() - before);
    for (const list of [this.times, this.costs]) if (list.length > FRAMES) list.shift();
  }
  // Frames a second, over the last ones.
  rate() { const t = this.times; return t.length > 1 ? (1000 * (t.length - 1)) / (t.at(-1) - t[0]) : 0; }
  // Figures and plots, no oftener than one can read them; the last ones always.
  tell() {
    const now = performance.now(), wait = READABLE - (now - (this.toldAt ?? -READABLE));
    clearTimeout(this.telling);
    if (wait > 0) { this.telling = setTimeout(() => this.tell(), wait); return; }
    this.toldAt = now;
    this.readings();
  }
}
