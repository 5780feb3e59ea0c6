export * from "../src/controls";
