// Talks to the server that this page came from: the token in a header, answers line by line.
import { uniqueName } from "./dom.js";

const KEY = "sbafab-token";
const fragment = new URLSearchParams(location.hash.slice(1));
if (fragment.get("token")) {
  localStorage.setItem(KEY, fragment.get("token"));
  fragment.delete("token");
  history.replaceState(null, "", location.pathname + (fragment.toString() ? "#" + fragment : ""));
}
export const linkedDesign = fragment.get("design");
export const tab = uniqueName();

function request(path, body, signal) {
  const headers = { "X-Sbafab-Token": localStorage.getItem(KEY) ?? "" };
  const options = { headers, signal, cache: "no-store" };
  if (body !== undefined) {
    options.method = "POST";
    options.body = JSON.stringify(body);
    headers["Content-Type"] = "application/json";
  }
  return fetch(path, options);
}

// The answer's table; an answer that refuses throws its sentence.
export async function ask(path, body, signal) {
  const response = await request(path, body, signal);
  const answer = await response.json().catch(() => ({ message: `the studio answered ${response.status}` }));
  if (!response.ok) throw Object.assign(new Error(answer.message), { status: response.status });
  return answer;
}

// Calls `heard` with every line of the answer as it arrives.
export async function listen(path, body, heard, signal) {
  const response = await request(path, body, signal);
  if (!response.ok) {
    const answer = await response.json().catch(() => ({}));
    throw Object.assign(new Error(answer.message ?? `the studio answered ${response.status}`), { status: response.status });
  }
  const lines = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { value, done } = await lines.read();
    if (done) break;
    rest += value;
    const parts = rest.split("\n");
    rest = parts.pop();
    for (const part of parts) if (part) heard(JSON.parse(part));
  }
}
