import { defineConfig } from "vitest/config";

/** Files of a worker share one browser and rendered fixtures (`isolate: false`). */
export const BROWSER_TESTS = {
  environment: "node",
  isolate: false,
  maxWorkers: 2,
  testTimeout: 120_000,
  hookTimeout: 120_000,
} as const;

/** The viewer in Chromium. */
export default defineConfig({ test: { ...BROWSER_TESTS, include: ["test/browser/**/*.test.ts"] } });
