// Functions for all pages. A page defines `bench.complete` (promise of the milliseconds from navigation to the first complete view), `bench.set` (shows a step of a
// path) and `bench.quiet` (resolves when the view is complete). A step: { x, y (metres east and north of the scene's origin), mpp (metres per CSS pixel), look (degrees
// counter-clockwise from north) }; CesiumJS takes z (metres up) and pitch (degrees below the horizon), too.
"use strict";
const asked = new URLSearchParams(location.search);
const bench = { asked, start: JSON.parse(asked.get("start") ?? "null"), frames: 0 };
globalThis.bench = bench;

{
  // Counts the frames that a page requests.
  const plain = globalThis.requestAnimationFrame.bind(globalThis);
  bench.next = () => new Promise(plain);
  globalThis.requestAnimationFrame = (act) => plain((now) => {
    bench.frames += 1;
    act(now);
  });
}

/** Number of frame callbacks; a page that counts its frames itself defines `bench.pictures`. */
bench.drawn = () => bench.pictures?.() ?? bench.frames;

/** Walks along a path, one step per frame; returns the milliseconds between frames. */
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

/** Shows every `every`-th step until its view is complete. */
bench.visit = async (path, every) => {
  for (let k = 0; k < path.length; k += every) {
    bench.set(path[k]);
    await bench.quiet();
  }
};

/** Walks along a path repeatedly for some seconds, one step per screen frame. */
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

/** For image viewers: the manifest, the view that looks north, and a function from a step to U and V on the ground (spec/pyramid.md). */
bench.pyramid = async () => {
  const json = await (await fetch(`${asked.get("base")}/rendering.json`)).json();
  const view = json.views.find(({ look_at_deg }) => look_at_deg === 0);
  const tilt = Math.sin((view.pitch_deg * Math.PI) / 180);
  return { json, view, place: ({ x, y }) => [x, y * tilt] };
};
