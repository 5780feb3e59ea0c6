// The measures of a page. Each returns numbers that are printed unchanged.
import { Phone } from "./browser.mjs";

export const median = (values) => {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.floor(sorted.length / 2)];
};

export const quantile = (values, q) => [...values].sort((a, b) => a - b)[Math.min(values.length - 1, Math.floor(q * values.length))];

/** Measures the first complete view with an empty cache: milliseconds since navigation, CPU milliseconds, requests, bytes. */
export async function first(server, url, network) {
  const phone = await Phone.open();
  try {
    const [before, cpu] = [server.count, phone.cpu()];
    const ms = await phone.goto(url, network);
    const [after, spent] = [server.count, phone.cpu()];
    return { ms, cpu_ms: spent.all - cpu.all, requests: after.requests - before.requests, bytes: after.bytes - before.bytes, ...problems(phone) };
  } finally {
    await phone.close();
  }
}

/** Steps between the stops at which a path's tiles are fetched. */
const STOP = 4;

/**
 * Measures frames along a path whose tiles are all fetched: CPU milliseconds per frame, rasteriser included, median of `walks`. `free`: without frame rate limit,
 * for browsers with a GPU. With software GL a frame takes much longer than the screen's interval, and an unlimited page runs ahead of the rasteriser, which makes
 * wall and CPU times unreliable.
 */
export async function frames(server, url, path, { walks = 1, free = false } = {}) {
  const phone = await Phone.open({ unbound: free });
  try {
    await phone.goto(url);
    await phone.page.evaluate(([steps, every]) => globalThis.bench.visit(steps, every), [path.steps, STOP]);
    const taken = [];
    for (let k = 0; k < walks; k++) taken.push(await walk(phone, server, path));
    const figures = Object.fromEntries(Object.keys(taken[0]).map((key) => [key, median(taken.map((one) => one[key]))]));
    const about = await phone.page.evaluate(() => globalThis.bench.about?.() ?? {});
    return { ...figures, about, ...problems(phone) };
  } finally {
    await phone.close();
  }
}

/** Walks along a path once. Pages with their own render loop report their number of frames; for others it is at least one per step. */
async function walk(phone, server, path) {
  const pictures = () => phone.page.evaluate(() => globalThis.bench.pictures?.() ?? 0);
  const [cpu, count, before] = [await phone.settled(), server.count, await pictures()];
  const intervals = await phone.page.evaluate((steps) => globalThis.bench.walk(steps), path.steps);
  const [spent, sent, after] = [await phone.settled(), server.count, await pictures()];
  const n = Math.max(path.steps.length, after - before);
  return {
    cpu_ms: (spent.all - cpu.all) / n, page_ms: (spent.all - spent.gpu - cpu.all + cpu.gpu) / n, p50_ms: quantile(intervals, 0.5), p95_ms: quantile(intervals, 0.95),
    pictures: n, requests: sent.requests - count.requests, bytes: sent.bytes - count.bytes,
  };
}

/**
 * Measures memory after some seconds of use, activity during the idle seconds after that, and memory at their end. Reads an empty canvas in a second browser at the
 * same moment, so both share the browser's files equally (PSS).
 */
export async function stays(server, url, emptyUrl, path, { use_s, idle_s }) {
  const [phone, empty] = [await Phone.open(), await Phone.open()];
  try {
    await phone.goto(url);
    await empty.goto(emptyUrl);
    const fresh = phone.memory();
    await phone.page.evaluate(([steps, seconds]) => globalThis.bench.stroll(steps, seconds), [path.steps, use_s]);
    await phone.page.waitForTimeout(3000);
    await phone.settled();
    const [used, baseline] = [phone.memory(), empty.memory()];
    const [cpu, count, drawn] = [phone.cpu(), server.count, await phone.page.evaluate(() => globalThis.bench.drawn())];
    await phone.page.waitForTimeout(1000 * idle_s);
    const [spent, sent, then] = [phone.cpu(), server.count, await phone.page.evaluate(() => globalThis.bench.drawn())];
    const idle = { s: idle_s, frames: then - drawn, requests: sent.requests - count.requests, cpu_ms_per_s: (spent.all - cpu.all) / idle_s };
    const more = (ours, theirs) => ({ pss: ours.pss - theirs.pss, anonymous: ours.anonymous - theirs.anonymous });
    return { fresh, used, empty: baseline, beyond: more(used, baseline), rested: more(phone.memory(), empty.memory()), use_s, idle, ...problems(phone) };
  } finally {
    await phone.close();
    await empty.close();
  }
}

export async function picture(url, file) {
  const phone = await Phone.open({ dpr: 2 });
  try {
    await phone.goto(url);
    await phone.page.waitForTimeout(500);
    await phone.page.screenshot({ path: file, type: "jpeg", quality: 80 });
    return { file, about: await phone.page.evaluate(() => globalThis.bench.about?.() ?? {}), ...problems(phone) };
  } finally {
    await phone.close();
  }
}

const problems = (phone) => (phone.problems.length > 0 ? { problems: phone.problems.slice(0, 5) } : {});
