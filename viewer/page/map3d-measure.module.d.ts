export * from "../src/measure";
