export * from "../src/shade";
