// Uploads files and folders by the tus protocol 1.0.0: in pieces, several at a time, resumable, with rate and time left; then asks for their import.
"use strict";

const PIECE_BYTES = 16 * 2 ** 20;
const AT_A_TIME = 3;
const PAUSES_MS = [1000, 2000, 4000, 8000, 15000];
const RATE_MS = 8000;
const MEMORY = "map3d-uploads";
const KEEP_MS = 48 * 3600 * 1000;

const panel = document.getElementById("upload");
if (panel) {
  panel.hidden = false;
  new Uploader(panel);
}

/** Unfinished uploads by file: {url, time}. Kept in the browser, so that the same file resumes after the page was closed. */
function remembered() {
  try {
    const all = JSON.parse(localStorage.getItem(MEMORY) ?? "{}");
    return Object.fromEntries(Object.entries(all).filter(([, one]) => Date.now() - one.time < KEEP_MS));
  } catch {
    return {};
  }
}

function remember(key, url) {
  const all = remembered();
  if (url) all[key] = { url, time: Date.now() };
  else delete all[key];
  try {
    localStorage.setItem(MEMORY, JSON.stringify(all));
  } catch {
    // Without storage, an upload cannot resume after the page was closed.
  }
}

function base64(text) {
  return btoa(String.fromCharCode(...new TextEncoder().encode(text)));
}

/** Returns the files of a drop, those in folders with their paths. */
async function droppedFiles(items) {
  const entries = [...items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  const found = [];
  const read = async (entry) => {
    if (entry.isFile) {
      const file = await new Promise((done, fail) => entry.file(done, fail));
      found.push({ file, path: entry.fullPath.replace(/^\//, "") });
      return;
    }
    const reader = entry.createReader();
    for (;;) {
      const some = await new Promise((done, fail) => reader.readEntries(done, fail));
      if (some.length === 0) return;
      for (const one of some) await read(one);
    }
  };
  for (const entry of entries) await read(entry);
  return found;
}

function Uploader(place) {
  const texts = JSON.parse(place.dataset.texts);
  const find = (name) => place.querySelector(`[data-${name}]`);
  const items = [];
  const samples = [];
  let going = false, paused = false, sending = false;

  const text = (name, values = {}) => Object.entries(values).reduce((all, [key, value]) => all.replace(`{${key}}`, value), texts[name]);

  function add(files) {
    for (const { file, path } of files) {
      if (path.split("/").some((name) => name.startsWith(".") || name === "Thumbs.db" || name === "__MACOSX")) continue;
      if (items.some((item) => item.path === path)) continue;
      const key = `${place.dataset.scene}|${path}|${file.size}|${file.lastModified}`;
      items.push({ file, path, key, sent: 0, state: "waiting", tries: 0, row: row(path, file.size) });
    }
    find("list").hidden = items.length === 0;
    draw();
  }

  function row(path, size) {
    const line = document.createElement("li");
    const name = Object.assign(document.createElement("span"), { className: "name", textContent: path });
    const state = Object.assign(document.createElement("span"), { className: "facts", textContent: sizeText(size) });
    const bar = Object.assign(document.createElement("progress"), { max: Math.max(1, size), value: 0 });
    bar.setAttribute("aria-label", path);
    line.append(name, state, bar);
    if (find("files").childElementCount < 200) find("files").append(line);
    return { line, state, bar };
  }

  function draw() {
    const total = items.reduce((sum, item) => sum + item.file.size, 0), sent = items.reduce((sum, item) => sum + item.sent, 0);
    for (const item of items) {
      item.row.bar.value = item.file.size ? item.sent : item.state === "done" ? 1 : 0;
      const detail = item.state === "sending" ? text("of", { done: sizeText(item.sent), total: sizeText(item.file.size) }) : item.state === "waiting" ? sizeText(item.file.size) : texts[item.state];
      item.row.state.textContent = item.note ? `${detail} · ${item.note}` : detail;
      item.row.line.dataset.state = item.state;
    }
    find("total").textContent = `${items.length === 1 ? items[0].path : text("files", { count: numberText(items.length) })} · ${text("of", { done: sizeText(sent), total: sizeText(total) })}`;
    find("all").max = Math.max(1, total);
    find("all").value = sent;
    find("rate").textContent = going && !paused ? rateText(sent, total) : paused ? texts.paused : "";
  }

  /** Returns the mean rate of the last seconds and the time left. */
  function rateText(sent, total) {
    const now = performance.now();
    samples.push([now, sent]);
    while (samples.length > 2 && now - samples[0][0] > RATE_MS) samples.shift();
    const [then, before] = samples[0];
    if (now - then < 500) return "";
    const rate = Math.max(0, (sent - before) / ((now - then) / 1000));
    return rate > 0 ? `${sizeText(rate)}/s · ${text("left", { time: timeText((total - sent) / rate) })}` : "";
  }

  function complain(message) {
    find("problem").hidden = !message;
    find("problem").textContent = message;
  }

  /** Sends a request; `onProgress` receives the bytes of the body that are on their way. Rejects without a connection. */
  function request(item, method, url, headers, body = null, onProgress = null) {
    return new Promise((done, fail) => {
      const sent = new XMLHttpRequest();
      sent.open(method, url);
      for (const [name, value] of Object.entries({ "Tus-Resumable": "1.0.0", "X-CSRF-Token": place.dataset.csrf, ...headers })) sent.setRequestHeader(name, value);
      if (onProgress) sent.upload.onprogress = (event) => onProgress(event.loaded);
      sent.onload = () => done(sent);
      sent.onerror = sent.ontimeout = () => fail(new Error("connection"));
      sent.onabort = () => fail(new Error("paused"));
      item.request = sent;
      sent.send(body);
    });
  }

  /** Finds out where to resume: at the offset of an earlier upload of the same file, or at 0 of a new one. */
  async function begin(item) {
    const earlier = item.url ?? remembered()[item.key]?.url;
    if (earlier) {
      const head = await request(item, "HEAD", earlier, {});
      if (head.status === 200 && Number(head.getResponseHeader("Upload-Length")) === item.file.size) {
        item.sent = Number(head.getResponseHeader("Upload-Offset"));
        if (item.sent > 0 && !item.url) item.note = texts.resumed;
        item.url = earlier;
        return;
      }
      if (head.status !== 200 && head.status !== 404) throw refusal(head);
    }
    const made = await request(item, "POST", place.dataset.uploads, { "Upload-Length": String(item.file.size), "Upload-Metadata": `filename ${base64(item.path)}` });
    if (made.status !== 201) throw refusal(made);
    item.url = new URL(made.getResponseHeader("Location"), new URL(place.dataset.uploads, location.href)).href;
    item.sent = 0;
    remember(item.key, item.url);
  }

  async function send(item) {
    await begin(item);
    while (item.sent < item.file.size) {
      if (paused) throw new Error("paused");
      const start = item.sent, headers = { "Upload-Offset": String(start), "Content-Type": "application/offset+octet-stream" };
      const piece = item.file.slice(start, start + PIECE_BYTES);
      const answer = await request(item, "PATCH", item.url, headers, piece, (bytes) => { item.sent = start + Math.min(bytes, piece.size); });
      if (answer.status !== 204) {
        item.sent = start;
        throw refusal(answer);
      }
      item.sent = Number(answer.getResponseHeader("Upload-Offset"));
      item.tries = 0;
    }
    item.state = "done";
  }

  /** A refusal that a later attempt may overcome has `again`. */
  function refusal(answer) {
    const signedOut = answer.status === 401 || answer.status === 403;
    const error = new Error(signedOut ? texts.signin : answer.responseText.trim() || `${answer.status}`);
    error.again = [408, 409, 423, 429, 460, 500, 502, 503, 504].includes(answer.status);
    error.wait = signedOut || answer.status === 507;
    return error;
  }

  /** Takes files one after another until none waits. */
  async function work() {
    for (let item; !paused && (item = items.find((one) => one.state === "waiting")); ) {
      item.state = "sending";
      try {
        await send(item);
        item.note = "";
      } catch (error) {
        if (error.message === "paused") item.state = "waiting";
        else if (error.message === "connection" || error.again) {
          item.note = texts.retrying;
          await new Promise((done) => setTimeout(done, PAUSES_MS[Math.min(item.tries, PAUSES_MS.length - 1)]));
          item.tries += 1;
          item.state = "waiting";
        } else if (error.wait) {
          item.state = "waiting";
          complain(error.message);
          pause(true);
        } else {
          item.state = "failed";
          item.note = error.message;
        }
      }
      draw();
    }
  }

  async function start() {
    if (going) return;
    going = true;
    complain("");
    samples.length = 0;
    find("start").disabled = true;
    find("pause").hidden = false;
    const timer = setInterval(draw, 250);
    await Promise.all(Array.from({ length: AT_A_TIME }, work));
    clearInterval(timer);
    going = false;
    draw();
    if (paused) return;
    find("start").disabled = false;
    find("pause").hidden = true;
    if (items.every((item) => item.state === "done")) await ask();
    else complain(items.filter((item) => item.state === "failed").map((item) => item.note).slice(0, 3).join("\n"));
    for (const item of items) if (item.state === "failed") item.state = "waiting";
  }

  /** Asks the server to import the files, and shows the scene with the running import. */
  async function ask() {
    find("rate").textContent = texts.importing;
    sending = true;
    const form = new URLSearchParams(items.map((item) => ["file", item.url.split("/").pop()]));
    for (const field of place.querySelectorAll("[data-list] [name]")) if (field.value && (field.type !== "checkbox" || field.checked)) form.set(field.name, field.value);
    const answer = await fetch(place.dataset.import, { method: "POST", body: form, headers: { "X-CSRF-Token": place.dataset.csrf, accept: "text/plain" } }).catch(() => null);
    if (answer?.ok) {
      for (const item of items) remember(item.key, null);
      location.assign(answer.url);
      return;
    }
    sending = false;
    complain(answer ? await answer.text() : texts.retrying);
  }

  function pause(on) {
    paused = on;
    find("pause").textContent = on ? texts.resume : texts.pause;
    if (on) for (const item of items) item.request?.abort();
    else {
      complain("");
      start();
    }
    draw();
  }

  function clear() {
    paused = true;
    for (const item of items) {
      item.request?.abort();
      if (item.url) {
        remember(item.key, null);
        fetch(item.url, { method: "DELETE", headers: { "Tus-Resumable": "1.0.0", "X-CSRF-Token": place.dataset.csrf } }).catch(() => null);
      }
    }
    items.length = 0;
    find("files").replaceChildren();
    find("list").hidden = true;
    find("start").disabled = false;
    find("pause").hidden = true;
    complain("");
    setTimeout(() => { paused = false; });
  }

  for (const input of place.querySelectorAll("[data-pick]")) {
    input.addEventListener("change", () => {
      add([...input.files].map((file) => ({ file, path: file.webkitRelativePath || file.name })));
      input.value = "";
    });
  }
  if (!("webkitdirectory" in HTMLInputElement.prototype)) find("folder").hidden = true;
  const drop = place.querySelector(".drop");
  for (const name of ["dragenter", "dragover"]) drop.addEventListener(name, (event) => { event.preventDefault(); drop.dataset.over = ""; });
  for (const name of ["dragleave", "drop"]) drop.addEventListener(name, () => { delete drop.dataset.over; });
  drop.addEventListener("drop", async (event) => {
    event.preventDefault();
    add(await droppedFiles(event.dataTransfer.items));
  });
  find("start").addEventListener("click", start);
  find("pause").addEventListener("click", () => pause(!paused));
  find("clear").addEventListener("click", clear);
  addEventListener("beforeunload", (event) => { if (going && !sending) event.preventDefault(); });
}
