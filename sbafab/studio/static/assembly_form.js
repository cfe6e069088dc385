// The form of an assembly: its own keys, and a section a part with all that part's keys and a way to open it.
import { el } from "./dom.js";
import { ask } from "./server.js";

const FIRST_PARTS = ["", "deploy"];

// Sections in order: table, its words, its fields, what stands at its head, whether it is open.
export function assemblySections(studio, present) {
  const { assembly, values } = studio, own = new Map();
  for (const field of assembly.fields) {
    const table = field.key.split(".").slice(0, -1).join(".");
    if (!own.has(table)) own.set(table, []);
    own.get(table).push(field);
  }
  const section = ([table, fields]) => ({ table, fields, open: FIRST_PARTS.includes(table) });
  const parts = Object.entries(values.parts).map(([name, part]) => partSection(studio, name, part, present));
  return [...[...own].filter(([table]) => !table).map(section), ...parts, { add: addPart(studio) }, ...[...own].filter(([table]) => table).map(section)];
}

// What the form is built from, but for values: built anew where it differs.
export function assemblyShape(studio, present) {
  const { values, parts } = studio;
  const sets = [...present].filter((key) => /^parts\.[^.]+\.set\./.test(key));
  return JSON.stringify([Object.entries(values.parts).map(([name, part]) => [name, part.kind]), sets, (parts ?? []).map(({ name, design }) => [name, design?.family])]);
}

function partSection(studio, name, part, present) {
  const others = Object.keys(studio.values.parts).filter((other) => other !== name);
  const fields = studio.assembly.kinds[part.kind].fields.map((field) => ({
    ...field, key: `parts.${name}.${field.key}`,
    ...(field.key === "on" ? { kind: "choice", choices: others } : {}),
  }));
  const made = studio.parts?.find((one) => one.name === name)?.design, prefix = `parts.${name}.set.`;
  const known = made ? studio.families[made.family] : [];
  const set = known.filter((field) => present.has(prefix + field.key)).map((field) => ({ ...field, key: prefix + field.key, label: field.key }));
  const head = el("div", { class: "part-head" },
    part.kind === "sba" ? el("button", { type: "button", "aria-label": `Open ${part.design}, the design of ${name}`, onclick: () => openPart(studio, name) }, "Open its design") : null,
    el("button", { type: "button", "aria-label": `Show ${name}`, onclick: () => studio.pickParts([name]) }, "Show"),
    el("button", { type: "button", class: "quiet", "aria-label": `Take ${name} out`, onclick: () => studio.edit([[`parts.${name}`, null]]) }, "Take out"),
    made ? setKey(studio, name, made, known.filter((field) => !present.has(prefix + field.key))) : null);
  return { table: `parts.${name}`, words: name, small: part.kind === "sba" ? part.design : part.kind, fields: [...set, ...fields], head, open: part.kind === "sba" };
}

// Another key of the part's design to be set here, at the value that it has.
function setKey(studio, name, made, fields) {
  return el("select", { "aria-label": `Set a key of the design of ${name}`, onchange: (event) => {
    const field = fields.find(({ key }) => key === event.target.value);
    const value = field?.key.split(".").reduce((inner, part) => inner?.[part], made.values) ?? field?.default ?? "";
    if (field) studio.edit([[`parts.${name}.set.${field.key}`, JSON.stringify(value)]]);
  } }, el("option", { value: "" }, "Set a key of it …"), ...fields.filter(({ key }) => key !== "name").map(({ key }) => el("option", { value: key }, key)));
}

function addPart(studio) {
  const { kinds } = studio.assembly;
  const kind = el("select", { "aria-label": "Kind of the new part" }, ...Object.entries(kinds).map(([name, { meaning }]) => el("option", { value: name, title: meaning }, name)));
  return el("div", { class: "part-add" }, kind, el("button", { type: "button", onclick: () => {
    const taken = new Set(Object.keys(studio.values.parts)), own = kind.value;
    let name = own;
    for (let i = 2; taken.has(name); i++) name = `${own}${i}`;
    const root = Object.entries(studio.values.parts).find(([, part]) => !part.on) ?? [null, {}];
    const needs = { design: '"1dof-5mm"', width: "20", length: "20", thickness: "2", material: '"acrylic"' };
    const edits = [["kind", JSON.stringify(own)], ...kinds[own].needs.map((key) => [key, needs[key]]), ["on", JSON.stringify(root[0])], ["at", root[1].kind === "tube" ? '"end"' : '"top"']];
    studio.edit(edits.map(([key, value]) => [`parts.${name}.${key}`, value]));
  } }, "Add a part"));
}

// The design of a part as a design of its own, with the keys that the assembly sets; the assembly waits.
export async function openPart(studio, name) {
  studio.commit();
  const part = studio.values.parts[name], back = { name: studio.name, text: studio.text, savedText: studio.savedText, seen: studio.seen, title: studio.name ?? studio.designName, part: name, source: part.design };
  const file = part.design.replace(/^\.\//, "");
  try {
    if (studio.templates.includes(part.design)) {
      const { text } = await ask(`/api/template/${encodeURIComponent(part.design)}`);
      studio.open(text, { back });
      studio.edit(flat(part.set ?? {}));
    } else {
      const { text, sha } = await ask(`/api/file/${encodeURIComponent(file)}`);
      studio.open(text, { name: file, seen: sha, back });
    }
  } catch (error) { studio.emit("told", `${part.design} cannot be opened here: ${error.message}`); }
}
function flat(table, prefix = "") {
  return Object.entries(table).flatMap(([key, value]) => (value && typeof value === "object" && !Array.isArray(value) ? flat(value, `${prefix}${key}.`) : [[prefix + key, JSON.stringify(value)]]));
}

// Back to the assembly; a template that was saved as a file meanwhile takes the template's place.
export function goBack(studio) {
  const { back, name } = studio;
  studio.commit();
  if (studio.unsaved && name && !confirm(`Leave ${name} without saving? This cannot be undone.`)) return;
  studio.open(back.text, { name: back.name, seen: back.seen, saved: back.savedText });
  if (!name || name === back.source.replace(/^\.\//, "")) return;
  studio.edit([[`parts.${back.part}.design`, JSON.stringify(name)], [`parts.${back.part}.set`, null]]);
  studio.emit("told", `${back.part} is now made from ${name}; Undo takes that back.`);
}
