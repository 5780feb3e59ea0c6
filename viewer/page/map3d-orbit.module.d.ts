export * from "../src/orbit";
