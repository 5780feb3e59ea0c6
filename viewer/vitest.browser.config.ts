import { defineConfig } from "vitest/config";

// Files share fixtures (isolate: false), since rendering one takes seconds. On a busy machine a gesture may come out slower than it was meant: such a test has two more attempts.
export default defineConfig({ test: { retry: 2, include: ["test/browser/**/*.test.ts", "test/browsers/**/*.test.ts"], environment: "node", isolate: false, testTimeout: 300_000, hookTimeout: 300_000, maxWorkers: 2 } });
