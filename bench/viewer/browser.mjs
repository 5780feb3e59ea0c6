// Chromium as a phone of 390 × 844 CSS pixels with a pixel ratio of 3, and the resource usage of its processes, from /proc.
import { readdirSync, readFileSync } from "node:fs";
import { chromium } from "../../viewer/node_modules/playwright-core/index.mjs";

const ARGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"];
const UNLIMITED = ["--disable-frame-rate-limit", "--disable-gpu-vsync"];
export const SIZE = { width: 390, height: 844 };
const TICK_MS = 10; // USER_HZ is 100 on Linux

/** A new browser with one page; `unbound`: without frame rate limit. */
export class Phone {
  static async open({ unbound = false, dpr = 3 } = {}) {
    const phone = new Phone();
    phone.server = await chromium.launchServer({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", headless: true, args: unbound ? [...ARGS, ...UNLIMITED] : ARGS });
    phone.process = phone.server.process().pid;
    const browser = await chromium.connect(phone.server.wsEndpoint());
    const context = await browser.newContext({ viewport: SIZE, deviceScaleFactor: dpr, isMobile: true, hasTouch: true });
    phone.page = await context.newPage();
    phone.page.setDefaultTimeout(600_000);
    phone.problems = [];
    phone.page.on("pageerror", (error) => phone.problems.push(String(error)));
    phone.page.on("console", (message) => { if (message.type() === "error") phone.problems.push(message.text()); });
    return phone;
  }

  /** Opens a page and waits for its first complete view; milliseconds since the navigation began. */
  async goto(url, network) {
    if (network) {
      const session = await this.page.context().newCDPSession(this.page);
      await session.send("Network.enable");
      await session.send("Network.emulateNetworkConditions", { offline: false, ...network });
    }
    await this.page.goto(url);
    return this.page.evaluate(() => globalThis.bench.complete);
  }

  async close() {
    await this.server.close();
  }

  /** CPU milliseconds so far: of all processes, and of the GPU process (with software GL: the rasteriser). */
  cpu() {
    let [all, gpu] = [0, 0];
    for (const member of processTree(this.process)) {
      const spent = cpuOf(member);
      all += spent;
      if (read(member, "cmdline").includes("--type=gpu-process")) gpu += spent;
    }
    return { all, gpu };
  }

  /** Pauses the page until the rasteriser, which lags behind it, has finished; returns the CPU time so far. */
  async settled() {
    await this.page.evaluate(() => globalThis.bench.pause?.(true));
    for (let [last, still, tries] = [this.cpu().all, 0, 0]; still < 3 && tries < 200; tries++) {
      await this.page.waitForTimeout(300);
      const now = this.cpu().all;
      still = now - last <= 30 ? still + 1 : 0;
      last = now;
    }
    const spent = this.cpu();
    await this.page.evaluate(() => globalThis.bench.pause?.(false));
    return spent;
  }

  /** Bytes of all processes: PSS, and its anonymous part. */
  memory() {
    let [pss, anonymous] = [0, 0];
    for (const member of processTree(this.process)) {
      const text = read(member, "smaps_rollup");
      const of = (name) => 1024 * Number(new RegExp(`^${name}:\\s+(\\d+)`, "m").exec(text)?.[1] ?? 0);
      pss += of("Pss");
      anonymous += of("Pss_Anon") + of("Pss_Shmem");
    }
    return { pss, anonymous };
  }
}

function read(process, file) {
  try {
    return readFileSync(`/proc/${process}/${file}`, "utf8");
  } catch {
    return ""; // the process has exited
  }
}

const statOf = (process) => read(process, "stat").split(") ").at(-1).split(" ");

/** CPU milliseconds of a process and its exited children. */
function cpuOf(process) {
  const fields = statOf(process);
  return fields.length < 15 ? 0 : TICK_MS * [11, 12, 13, 14].reduce((sum, k) => sum + Number(fields[k]), 0);
}

function processTree(process) {
  const children = new Map();
  for (const name of readdirSync("/proc")) {
    if (!/^\d+$/.test(name)) continue;
    const parent = Number(statOf(name)[1]);
    children.set(parent, [...(children.get(parent) ?? []), Number(name)]);
  }
  const found = [process];
  for (const member of found) found.push(...(children.get(member) ?? []));
  return found;
}
