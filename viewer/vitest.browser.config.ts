import { defineConfig } from "vitest/config";

export default defineConfig({ test: { include: ["test/browser/**/*.test.ts", "test/browsers/**/*.test.ts"], environment: "node", testTimeout: 120_000, hookTimeout: 120_000, maxWorkers: 2 } });
