import { expect, test } from "vitest";
import type { Map3D, Vec3 } from "../../src/map3d";
import { embedCode } from "../../src/element/embedCode";

const view = (fields: object): Map3D =>
  ({
    center: [691015.04, 5336015, 520] as Vec3,
    direction: "0-45",
    zoom: 2.6,
    light: { azimuth_deg: 215, elevation_deg: 48 },
    time: null,
    ...fields,
  }) as unknown as Map3D;

test("the lines show the present view and light, with names escaped", () => {
  expect(embedCode(view({}), { src: "/town/", label: 'Our "office" <b> & more' }))
    .toBe(`<map-3d src="/town" label="Our &quot;office&quot; &lt;b> &amp; more" direction="0-45" center="691015.0 5336015.0 520.0" zoom="2.60" light="215.0 48.0"></map-3d>
<script src="/town/map3d.js"></script>
<script src="/town/map3d-element.js"></script>
`);
  expect(embedCode(view({ time: new Date("2026-06-21T14:05:30.5Z") }), { src: "https://maps.example.org/town" })).toContain(
    ' time="2026-06-21T14:05Z"></map-3d>',
  );
});

test("a map without a view, and a missing folder, are refused", () => {
  expect(() => embedCode(view({ center: null }), { src: "/town" })).toThrow('embedCode: the map has no view yet; call it after "ready"');
  expect(() => embedCode(view({}), {} as { src: string })).toThrow("embedCode: expected { src }, the folder of the rendering");
});
