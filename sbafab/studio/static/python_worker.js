// Python in a worker of the page: runs sbafab's own code, one step of an answer after the other.
const HERE = new URL("./python/", import.meta.url);
const waiting = [];
let running = false;

const ready = (async () => {
  const { archives, wheels } = await (await fetch(new URL("python.json", HERE))).json();
  const { loadPyodide } = await import(new URL("pyodide.mjs", HERE));
  const python = await loadPyodide({ indexURL: HERE.href });
  if (wheels.length) await python.loadPackage(wheels.map((name) => new URL(name, HERE).href), { messageCallback: () => {} });
  const site = python.runPython("import site; site.getsitepackages()[0]");
  for (const name of archives) python.unpackArchive(await (await fetch(new URL(name, HERE))).arrayBuffer(), "zip", { extractDir: site });
  return python.pyimport("sbafab.studio.in_page");
})();

addEventListener("message", ({ data }) => {
  if (data.abort) {
    const wish = waiting.find(({ number }) => number === data.number);
    if (wish) wish.abort = true;
    return;
  }
  waiting.push(data);
  if (!running) work();
});

async function work() {
  running = true;
  try {
    const studio = await ready;
    while (waiting.length) {
      await turn();
      const wish = waiting[0];
      try { await answer(studio, wish); } catch (error) { postMessage({ number: wish.number, failed: lastLine(error) }); }
      waiting.shift();
    }
  } catch (error) {
    for (const { number } of waiting.splice(0)) postMessage({ number, failed: lastLine(error) });
  }
  running = false;
}
async function answer(studio, wish) {
  const { number } = wish;
  if (wish.made) {
    const found = studio.made_bytes(wish.made), content = found?.toJs() ?? null;
    found?.destroy();
    postMessage({ number, content, done: true });
    return;
  }
  const lines = studio.answers(wish.path, wish.body, (line) => postMessage({ number, line }));
  // Between two lines messages come in, so that a newer wish need not wait for the rest of this one.
  for (let next = lines.next(); !next.done && !wish.abort; next = lines.next()) {
    postMessage({ number, line: next.value });
    await turn();
  }
  if (wish.abort) lines.return();
  lines.destroy();
  postMessage({ number, done: true });
}
const turn = () => new Promise((done) => { const { port1, port2 } = new MessageChannel(); port1.onmessage = () => { port1.close(); done(); }; port2.postMessage(0); });
const lastLine = (error) => `Python in this page: ${String(error.message ?? error).trim().split("\n").pop()}`;
