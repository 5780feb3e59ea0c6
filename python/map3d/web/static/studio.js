// Keeps pages with running operations up to date: fetches the page again and replaces its parts marked data-live.
"use strict";

const PAUSE_MS = 1500;

async function refresh() {
  const response = await fetch(location.href, { headers: { accept: "text/html" } });
  if (!response.ok) return location.reload();
  if (response.redirected) return location.assign(response.url);
  const fresh = new DOMParser().parseFromString(await response.text(), "text/html");
  for (const part of document.querySelectorAll("[data-live]")) {
    const other = fresh.getElementById(part.id);
    if (other && !part.contains(document.activeElement) && other.innerHTML !== part.innerHTML) part.replaceWith(document.adoptNode(other));
  }
  for (const other of fresh.querySelectorAll("[data-live]")) {
    if (!document.getElementById(other.id)) return location.reload();
  }
  document.getElementById("main").toggleAttribute("data-poll", fresh.getElementById("main").hasAttribute("data-poll"));
}

async function poll() {
  const running = document.getElementById("main").hasAttribute("data-poll");
  try {
    if (running && !document.hidden) await refresh();
  } catch {
    // The server cannot be reached for now.
  }
  setTimeout(poll, PAUSE_MS);
}

setTimeout(poll, PAUSE_MS);
