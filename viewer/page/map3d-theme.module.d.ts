export * from "../src/theme";
