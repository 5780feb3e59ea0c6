// The form of a new rendering: pictures and estimate follow the fields.
"use strict";

const form = document.getElementById("new-rendering");

function later(milliseconds, act) {
  let timer = 0;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(act, milliseconds);
  };
}

if (form) {
  const whole = document.getElementById("whole"), detail = document.getElementById("detail");
  const problem = document.getElementById("preview-problem"), estimate = document.getElementById("estimate");
  let at = null, asked = 0;

  const query = (values) => new URLSearchParams(values).toString();
  const field = (name) => form.elements[name].value;

  /** Loads a picture beside the shown one, and shows it when it is there; a newer request wins. */
  async function show(image, values) {
    const number = (image.asked = (image.asked ?? 0) + 1);
    image.setAttribute("aria-busy", "true");
    const response = await fetch(`${form.dataset.preview}?${query(values)}`);
    if (number !== image.asked) return;
    problem.hidden = response.ok;
    if (response.ok) {
      const url = URL.createObjectURL(await response.blob());
      image.onload = () => URL.revokeObjectURL(url);
      image.src = url;
    } else problem.textContent = await response.text();
    image.removeAttribute("aria-busy");
  }

  function showBoth() {
    const view = { pitch: field("pitch"), look: field("look"), kind: field("kind") };
    show(whole, view);
    showDetail();
  }

  function showDetail() {
    const view = { pitch: field("pitch"), look: field("look"), kind: field("kind"), res: field("res") };
    if (field("res") > 0) show(detail, at ? { ...view, x: at[0].toFixed(4), y: at[1].toFixed(4) } : view);
  }

  async function showEstimate() {
    const number = ++asked;
    estimate.textContent = estimate.dataset.wait;
    const values = new URLSearchParams(new FormData(form));
    values.delete("csrf");
    const response = await fetch(`${form.dataset.estimate}?${values}`, { headers: { accept: "application/json" } }).catch(() => null);
    const found = response && (response.headers.get("content-type") ?? "").includes("json") ? await response.json() : { problem: response ? await response.text() : "" };
    if (number !== asked) return;
    const parts = found.problem === undefined ? [["strong", found.size], ["span", found.tiles], ["span", found.time]] : [["p", found.problem]];
    estimate.replaceChildren(...parts.map(([tag, text]) => Object.assign(document.createElement(tag), { textContent: text })));
    estimate.toggleAttribute("data-problem", found.problem !== undefined);
  }

  const soonBoth = later(200, showBoth), soonDetail = later(200, showDetail), soonEstimate = later(700, showEstimate);
  form.addEventListener("input", (event) => {
    const { name, value } = event.target;
    if (name === "pitch") document.getElementById("pitch-text").textContent = `${numberText(Number(value))}°`;
    if (name === "look") at = null;
    if (["pitch", "look", "kind"].includes(name)) soonBoth();
    if (name === "res") soonDetail();
    if (!["look", "kind", "title", "name"].includes(name)) soonEstimate();
  });

  const choose = (x, y) => {
    at = [Math.min(1, Math.max(0, x)), Math.min(1, Math.max(0, y))];
    showDetail();
  };
  whole.addEventListener("click", (event) => {
    const box = whole.getBoundingClientRect();
    choose((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
  });
  whole.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-0.05, 0], ArrowRight: [0.05, 0], ArrowUp: [0, -0.05], ArrowDown: [0, 0.05] }[event.key];
    if (!step) return;
    event.preventDefault();
    const [x, y] = at ?? [0.5, 0.5];
    choose(x + step[0], y + step[1]);
  });
  showEstimate();
}
