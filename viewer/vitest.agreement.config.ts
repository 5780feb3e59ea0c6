import { defineConfig } from "vitest/config";
import { BROWSER_TESTS } from "./vitest.browser.config";

/** Agreement with other people's programs: Firefox, WebKitGTK, bundlers, TypeScript's ways to find types. */
export default defineConfig({ test: { ...BROWSER_TESTS, include: ["test/browsers/**/*.test.ts", "test/bundlers/**/*.test.ts"] } });
