export * from "../src/offline";
