export * from "../src/compare";
