export * from "../src/print";
