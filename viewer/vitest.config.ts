import { defineConfig } from "vitest/config";

/** The build bundles the workers; these tests start none. */
const workers = {
  name: "workers",
  resolveId: (id: string) => (id.startsWith("worker:") ? "\0worker" : null),
  load: (id: string) => (id === "\0worker" ? 'export default ""' : null),
};

export default defineConfig({
  plugins: [workers],
  test: { include: ["test/unit/**/*.test.ts"], environment: "node", testTimeout: 120_000 },
});
