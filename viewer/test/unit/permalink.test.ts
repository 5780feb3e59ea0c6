import { expect, test } from "vitest";
import { readPermalink } from "../../page/permalink";

test("a permalink holds the view, time and object", () => {
  expect(readPermalink("#45-22.5/691000.5/5336000.0/512.3/4.20")).toEqual({
    direction: "45-22.5",
    center: [691000.5, 5336000, 512.3],
    zoom: 4.2,
  });
  expect(readPermalink("#0-45/-1/2/3/0/t=2026-06-21T15:00Z/id=4000000000")).toEqual({
    direction: "0-45",
    center: [-1, 2, 3],
    zoom: 0,
    time: new Date("2026-06-21T15:00:00Z"),
    id: 4_000_000_000,
  });
  expect(readPermalink(`#0-45/1/2/3/4/by=${encodeURIComponent(encodeURIComponent("a/b=c d%"))}`).by).toBe("a/b=c d%");
  expect(readPermalink("#0-45/1/2/3/4/epoch=2").epoch).toBe(2);
  expect(readPermalink("#0-45%2F1%2F2%2F3%2F4").center).toEqual([1, 2, 3]);
});

test.each(["", "#", "#0-45", "#0-45/1/2/3", "#0-45/a/2/3/4", "#0-45/1//3/4", "#%", "#/1/2/3/4", "#javascript:alert(1)"])(
  "an invalid permalink such as %s is ignored",
  (hash) => {
    expect(readPermalink(hash)).toEqual({});
  },
);

test.each(["t=", "t=soon", "by=", "by=%25E0%25A4%25A", "id=", "id=-3", "id=1.5", "id=x", "x=1"])(
  "an invalid or unknown part, %s, is ignored",
  (part) => {
    expect(readPermalink(`#0-45/1/2/3/4/${part}`)).toEqual({ direction: "0-45", center: [1, 2, 3], zoom: 4 });
  },
);
