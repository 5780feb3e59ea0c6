import { describe, expect, test } from "vitest";
import type { Map3D } from "../../src/map3d";
import { Sync } from "../../src/compare/sync";

describe("maps that move together", () => {
  const make = (): Map3D => ({}) as unknown as Map3D;
  const fake = make();

  test.each<[string, readonly Map3D[], object, RegExp]>([
    ["one map", [fake], {}, /sync needs at least two different maps, got 1/],
    ["the same map twice", [fake, fake], {}, /at least two different maps/],
    ["too few turns", [fake, make()], { turns_deg: [0] }, /turns_deg must be a number of degrees for each of the 2 maps/],
    ["turns that are no numbers", [fake, make()], { turns_deg: [0, "180"] }, /turns_deg must be a number of degrees/],
  ])("%s are refused", (_, maps, options, message) => {
    expect(() => new Sync(maps, options)).toThrow(
      expect.objectContaining({ name: "UsageError", message: expect.stringMatching(message) as string }),
    );
  });
});
