// A button that plays something round and round until it is pressed again.
import { el } from "./dom.js";

// ms of a round.
const ROUND = 4000;

export class Playing {
  // `begin` gives what shows the angle of a turn, or nothing where there is nothing to play.
  constructor(begin, ended = () => {}) {
    Object.assign(this, { begin, ended });
    this.button = el("button", { "aria-pressed": "false", onclick: () => (this.on ? this.stop() : this.start()) }, "Play");
  }
  get on() { return Boolean(this.frame); }
  start() {
    const show = this.begin(), start = performance.now();
    if (!show) return;
    this.say("Pause", true);
    const step = () => {
      show(((performance.now() - start) / ROUND) * 2 * Math.PI);
      this.frame = requestAnimationFrame(step);
    };
    this.frame = requestAnimationFrame(step);
  }
  stop() {
    if (!this.on) return;
    cancelAnimationFrame(this.frame);
    this.frame = null;
    this.say("Play", false);
    this.ended();
  }
  say(words, on) { this.button.textContent = words; this.button.setAttribute("aria-pressed", String(on)); }
}
