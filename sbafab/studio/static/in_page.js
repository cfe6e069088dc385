// Answers what a server would answer, by Python in workers of this page. Edits and rules have one of their own, so
// that they never wait for what takes long.
const QUICK = /^\/api\/(start|template|live)/;
const workers = {};
let asked = 0;

class PythonWorker {
  constructor() {
    this.heard = new Map();
    this.worker = new Worker(new URL("./python_worker.js", import.meta.url), { type: "module" });
    this.worker.addEventListener("message", ({ data }) => this.heard.get(data.number)?.(data));
    this.worker.addEventListener("error", (event) => {
      for (const heard of [...this.heard.values()]) heard({ failed: event.message || "Python did not start in this page" });
    });
  }
  // Calls `heard` with every message of the answer; done with the last one.
  request(message, heard, signal) {
    const number = ++asked;
    return new Promise((done, failed) => {
      const end = (settle, value) => { this.heard.delete(number); signal?.removeEventListener("abort", abort); settle(value); };
      const abort = () => { this.worker.postMessage({ number, abort: true }); end(failed, new DOMException("given up", "AbortError")); };
      if (signal?.aborted) { failed(new DOMException("given up", "AbortError")); return; }
      signal?.addEventListener("abort", abort);
      this.heard.set(number, (data) => {
        if (data.failed) end(failed, new Error(data.failed));
        else if (data.done) end(done, data);
        else heard(data.line);
      });
      this.worker.postMessage({ number, ...message });
    });
  }
}
function workerOf(path) {
  const name = QUICK.test(path) ? "quick" : "slow";
  return (workers[name] ??= new PythonWorker());
}

export async function ask(path, body, signal) {
  let answer = null;
  await listen(path, body, (line) => { answer = line; }, signal);
  if (answer.kind === "error") throw Object.assign(new Error(answer.message), { status: 422 });
  return answer;
}
export async function listen(path, body, heard, signal) {
  await workerOf(path).request({ path, body: JSON.stringify(body ?? {}) }, (line) => heard(JSON.parse(line)), signal);
}
const TYPES = { svg: "image/svg+xml", png: "image/png", html: "text/html", zip: "application/zip", json: "application/json" };
// A link to a file that a run wrote into the page's memory.
export async function madeLink(path) {
  const { content } = await workerOf(path).request({ made: path }, () => {});
  if (!content) throw new Error(`${path} is not there`);
  return URL.createObjectURL(new Blob([content], { type: TYPES[path.split(".").pop()] ?? "application/octet-stream" }));
}
