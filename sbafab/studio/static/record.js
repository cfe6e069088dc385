// The record page: the fields of the paper page, in its order; a filled row becomes a line of a device's history.
import { $, el, recall, remember } from "./dom.js";
import { ask } from "./server.js";

const DECISIONS = ["", "accept", "reject", "rework"];
const DAYS = ["date", "expires"];
const NUMBERS = ["kerf_mm", "temperature_c", "press_force_n", "minutes"];
const WIDE = ["reason", "photograph", "note"];
const LONGEST = 1280;
const DRAFT = "sbafab-record";
const form = $("#record");
const initials = () => recall("sbafab-initials", "");

function control(field, name) {
  if (field.name === "decision") return el("select", { name }, ...DECISIONS.map((word) => el("option", { value: word }, word)));
  if (field.name === "photograph") return el("input", { name, type: "file", accept: "image/*" });
  const type = DAYS.includes(field.name) ? "date" : "text";
  return el("input", { name, type, inputmode: NUMBERS.includes(field.name) ? "decimal" : false });
}

function row(fields, { values, nominal }, name) {
  const [preset] = Object.values(values);
  const title = /^\d/.test(preset) ? `Step ${preset}` : preset;
  const shown = fields.filter((field) => !(field.name in values));
  const labels = shown.map((field) => el("label", { class: WIDE.includes(field.name) ? "wide" : false, title: field.says }, field.label, control(field, `${name}.${field.name}`)));
  const box = el("fieldset", { "data-values": JSON.stringify(values) }, el("legend", {}, title), nominal ? el("p", {}, nominal) : null, ...labels);
  box.addEventListener("input", (event) => {
    const writer = box.querySelector("[name$='.initials']");
    if (event.target === writer) remember("sbafab-initials", writer.value);
    else if (writer && !writer.value) writer.value = initials();
    mark(box);
  });
  return box;
}

const controls = (box) => [...box.querySelectorAll("[name]")];
const isFilled = (box) => controls(box).some((input) => input.value && !input.name.endsWith(".initials"));
const mark = (box) => box.classList.toggle("filled", isFilled(box));

async function packed(file) {
  const picture = await createImageBitmap(file, { imageOrientation: "from-image" });
  const scale = Math.min(1, LONGEST / Math.max(picture.width, picture.height));
  const canvas = el("canvas", { width: Math.round(picture.width * scale), height: Math.round(picture.height * scale) });
  canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
  return canvas.toDataURL("image/jpeg", 0.85).split(",")[1];
}

async function line(box) {
  const values = { date: $("#date").value, serial: $("#serial").value, ...JSON.parse(box.dataset.values) };
  for (const input of controls(box)) {
    const name = input.name.split(".").pop();
    if (name === "photograph") { if (input.files[0]) values[name] = await packed(input.files[0]); } else if (input.value.trim()) values[name] = input.value.trim();
  }
  return values;
}

function say(words, kind = "") {
  const answer = $("#answer");
  answer.textContent = words;
  answer.className = kind;
}

// What was typed outlives a phone that goes to sleep; photographs do not.
const typed = () => [...form.querySelectorAll("input[name]:not([type=file]), select[name]")];
const keep = () => remember(DRAFT, { design: $("#design").value, values: Object.fromEntries(typed().map((input) => [input.name, input.value])) });
function restore() {
  const draft = recall(DRAFT, null);
  if (draft?.design !== $("#design").value) return;
  for (const input of typed()) if (draft.values[input.name]) input.value = draft.values[input.name];
  form.querySelectorAll("fieldset").forEach(mark);
}

async function choose() {
  say("…");
  try {
    const { tables } = await ask("/api/record/sheet", { design: $("#design").value });
    $("#tables").replaceChildren(...tables.flatMap(({ title, fields, rows }, place) => [el("h2", {}, title), ...rows.map((each, number) => row(fields, each, `${place}.${number}`))]));
    restore();
    say("");
  } catch (error) { say(error.message, "bad"); }
}

async function store(event) {
  event.preventDefault();
  const button = $("button", form);
  button.disabled = true;
  say("Storing …");
  try {
    const boxes = [...form.querySelectorAll("fieldset")].filter(isFilled);
    const entries = [];
    for (const box of boxes) entries.push(await line(box));
    const { entries: numbers, warnings } = await ask("/api/record", { design: $("#design").value, again: $("#again").checked, entries });
    for (const box of boxes) { for (const input of controls(box)) input.value = ""; mark(box); }
    $("#again").checked = false;
    keep();
    say([`Stored: ${numbers.join(", ")}.`, ...warnings.map((words) => `Warning: ${words}.`)].join(" "), warnings.length ? "bad" : "good");
  } catch (error) { say(error.message, "bad"); }
  button.disabled = false;
}

function today() {
  const now = new Date();
  return [now.getFullYear(), now.getMonth() + 1, now.getDate()].map((part) => String(part).padStart(2, "0")).join("-");
}

async function start() {
  try {
    const { files, templates, lab } = await ask("/api/record");
    const group = (label, names) => el("optgroup", { label }, ...names.map((name) => el("option", { value: name }, name)));
    $("#design").append(...[["Design files", files], ["Templates", templates]].filter(([, names]) => names.length).map(([label, names]) => group(label, names)));
    const last = recall(DRAFT, null)?.design;
    if ([...files, ...templates].includes(last)) $("#design").value = last;
    $("#date").value = today();
    $("#lab").textContent = `Lines go into ${lab}. Nothing is overwritten.`;
    $("#design").addEventListener("change", choose);
    form.addEventListener("input", keep);
    form.addEventListener("submit", store);
    await choose();
  } catch (error) { say(error.message, "bad"); }
}
start();
