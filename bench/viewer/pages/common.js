// What all pages share. A page makes `bench.complete` (milliseconds from navigation to the first complete view), `bench.set` (a step of a path) and
// `bench.quiet` (resolves when nothing is missing in view). A step: { x, y (metres east and north of the scene's origin), mpp (metres a CSS pixel), look (degrees
// counter-clockwise from north) }; CesiumJS takes z (metres up) and pitch (degrees below the horizon), too.
"use strict";
const asked = new URLSearchParams(location.search);
const bench = { asked, start: JSON.parse(asked.get("start") ?? "null"), frames: 0 };
globalThis.bench = bench;

{
  // Counts the pictures that a page asks for.
  const plain = globalThis.requestAnimationFrame.bind(globalThis);
  bench.next = () => new Promise(plain);
  globalThis.requestAnimationFrame = (act) => plain((now) => {
    bench.frames += 1;
    act(now);
  });
}

/** How often the page's code was called before a picture; a page that knows its pictures has `bench.pictures`. */
bench.drawn = () => bench.pictures?.() ?? bench.frames;

/** Goes through a path, a step a picture. Milliseconds between pictures. */
bench.walk = async (path) => {
  const intervals = [];
  let last = await bench.next();
  for (const step of path) {
    bench.set(step);
    const now = await bench.next();
    intervals.push(now - last);
    last = now;
  }
  await bench.quiet();
  return intervals;
};

/** Stops at every few steps until everything is there. */
bench.visit = async (path, every) => {
  for (let k = 0; k < path.length; k += every) {
    bench.set(path[k]);
    await bench.quiet();
  }
};

/** Along a path at the pace of the screen, over and over for some seconds; the browser stays usable meanwhile. */
bench.stroll = async (path, seconds) => {
  const end = performance.now() + 1000 * seconds;
  while (performance.now() < end) {
    for (const step of path) {
      if (performance.now() >= end) break;
      bench.set(step);
      await bench.next();
    }
  }
  await bench.quiet();
};

/** For viewers of pictures: the manifest, the view that looks north, and U and V of a step on the ground (spec/pyramid.md). */
bench.pyramid = async () => {
  const json = await (await fetch(`${asked.get("base")}/rendering.json`)).json();
  const view = json.views.find(({ look_at_deg }) => look_at_deg === 0);
  const tilt = Math.sin((view.pitch_deg * Math.PI) / 180);
  return { json, view, place: ({ x, y }) => [x, y * tilt] };
};
