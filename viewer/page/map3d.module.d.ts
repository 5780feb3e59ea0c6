export * from "../src/map3d";
