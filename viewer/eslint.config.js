import { dirname, relative, resolve } from "node:path";
import tseslint from "typescript-eslint";
import { ENTRIES } from "./scripts/entries.mjs";

/** Folders of src from the lowest rank up: a folder may import those of lower ranks, and itself. */
const RANKS = {
  core: 0,
  geo: 1,
  tiles: 2,
  draw: 3,
  overlay: 4,
  ui: 4,
  map: 5,
  map3d: 6,
  ...Object.fromEntries(Object.keys(ENTRIES).map((name) => [name, 7])),
};
/** Entries import the public names, and the two lowest folders. */
const SEEN_BY_ENTRIES = ["core", "geo", "map3d"];
const SRC = resolve(import.meta.dirname, "src");

const folderOf = (file) => relative(SRC, file).split(/[\\/]/)[0];

/** Imports go down only; siblings of one rank do not import each other. */
const importDirection = {
  meta: {
    type: "problem",
    messages: {
      up: "{{from}} may not import {{to}}: entries > map3d > map > {ui, overlay} > draw > tiles > geo > core; an entry imports map3d, geo and core only",
    },
    schema: [],
  },
  create(context) {
    const from = folderOf(context.filename);
    const check = (node) => {
      const path = node.source?.value?.replace(/^worker:/, "");
      if (!path?.startsWith(".") || !(from in RANKS)) return;
      const to = folderOf(resolve(dirname(context.filename), path));
      if (to !== from && (!(RANKS[to] < RANKS[from]) || !(!(from in ENTRIES) || SEEN_BY_ENTRIES.includes(to))))
        context.report({ node, messageId: "up", data: { from, to } });
    };
    return { ImportDeclaration: check, ExportNamedDeclaration: check, ExportAllDeclaration: check, ImportExpression: check };
  },
};

export default tseslint.config(
  { ignores: ["dist/", "node_modules/", "reference/"] },
  ...tseslint.configs.strictTypeChecked.map((config) => ({ ...config, files: ["**/*.ts"] })),
  {
    files: ["**/*.ts"],
    languageOptions: { parserOptions: { project: ["./tsconfig.json", "./tsconfig.test.json"], tsconfigRootDir: import.meta.dirname } },
    plugins: { map3d: { rules: { "import-direction": importDirection } } },
    rules: {
      "map3d/import-direction": "error",
      "max-lines": ["error", 500],
      "@typescript-eslint/no-confusing-void-expression": ["error", { ignoreArrowShorthand: true, ignoreVoidReturningFunctions: true }],
      "@typescript-eslint/no-misused-promises": ["error", { checksVoidReturn: false }],
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      "@typescript-eslint/no-unnecessary-condition": ["error", { allowConstantLoopConditions: true }],
      "@typescript-eslint/no-meaningless-void-operator": "off",
      "@typescript-eslint/no-extraneous-class": "off",
      "@typescript-eslint/no-empty-object-type": ["error", { allowInterfaces: "with-single-extends" }],
    },
  },
  { files: ["src/**/*.ts", "page/**/*.ts"], rules: { "max-lines-per-function": ["error", { max: 60 }] } },
  { files: ["test/**/*.ts"], rules: { "@typescript-eslint/no-unnecessary-type-parameters": "off" } },
);
