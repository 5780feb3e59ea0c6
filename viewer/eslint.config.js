import { dirname, relative, resolve } from "node:path";
import tseslint from "typescript-eslint";

/** Folders of src from the ground up: a folder may import those of lower ranks, and itself. */
const RANKS = { core: 0, geo: 1, tiles: 2, draw: 3, overlay: 4, ui: 4, map: 5, map3d: 6, measure: 7, theme: 7, print: 7, controls: 7 };
/** Entries of their own see what every page sees, and the ground. */
const ENTRIES = { measure: ["core", "map3d"], theme: ["core", "map3d"], print: ["core", "map3d"], controls: ["core", "map3d"] };
const SRC = resolve(import.meta.dirname, "src");

const folderOf = (file) => relative(SRC, file).split(/[\\/]/)[0];

/** Imports go down only; siblings of one rank do not import each other. */
const importDirection = {
  meta: { type: "problem", messages: { up: "{{from}} may not import {{to}}: {measure, theme, print, controls} > map3d > map > {ui, overlay} > draw > tiles > geo > core; an entry imports map3d and core only" }, schema: [] },
  create(context) {
    const from = folderOf(context.filename);
    const check = (node) => {
      const path = node.source?.value?.replace(/^worker:/, "");
      if (!path?.startsWith(".") || !(from in RANKS)) return;
      const to = folderOf(resolve(dirname(context.filename), path));
      if (to !== from && (!(RANKS[to] < RANKS[from]) || !(ENTRIES[from]?.includes(to) ?? true))) context.report({ node, messageId: "up", data: { from, to } });
    };
    return { ImportDeclaration: check, ExportNamedDeclaration: check, ExportAllDeclaration: check, ImportExpression: check };
  },
};

export default tseslint.config(
  { ignores: ["dist/", "node_modules/"] },
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
    },
  },
  { files: ["src/**/*.ts", "page/**/*.ts"], rules: { "max-lines-per-function": ["error", { max: 60 }] } },
  { files: ["test/**/*.ts"], rules: { "@typescript-eslint/no-unnecessary-type-parameters": "off" } },
);
