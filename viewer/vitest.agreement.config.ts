import { defineConfig } from "vitest/config";
import { ALL_ROWS } from "./test/browser/rows";
import { BROWSER_TESTS } from "./vitest.browser.config";

/** Agreement with other people's programs: Firefox, WebKitGTK, bundlers, TypeScript's ways to find types. Further rows of tests in Chromium. */
export default defineConfig({
  test: {
    ...BROWSER_TESTS,
    include: ["test/browsers/**/*.test.ts", "test/bundlers/**/*.test.ts", "test/browser/{offline,print,seams}.test.ts"],
    env: { [ALL_ROWS]: "1" },
  },
});
