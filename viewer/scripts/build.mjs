// Builds dist/: map3d.js (script), map3d.module.js (module), the entries, map3d-full (everything), the service worker, the ready-made page, and type declarations.
import { execFileSync } from "node:child_process";
import { mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import * as esbuild from "esbuild";
import { minify } from "terser";
import { ENTRIES } from "./entries.mjs";
import { MODULE_ORDER } from "./moduleOrder.mjs";

const root = resolve(dirname(fileURLToPath(import.meta.url)), "..");
const dist = join(root, "dist");
/** Names of members that only the core uses, and no public type has: bundles have short ones in their place. `checkInternalNames` fails where another file uses one. */
const INTERNAL_NAMES = `
  advanceCamera ahead attempts backoff_ms checkCompatible clearFailures clearPatches continueTurn copyToCanvas createName customLayers deselectMarkers dragBy dropTiles
  enterFullScreen exitFullScreen findCenterSurface findView fitCanvas forget freeAllBut fullScreen getOrCreate hasFailed initializeView isCombinable
  hovers inputs isCovered isLoaded isLoading isPositionOccluded lightLayers listNeeds listViewsAhead loadError makePass makeRequest nextCamera nextView onLoadError onManifest onUploaded packed peek pinned placeElement positionAt
  probes prune releaseData replaceCanvas requiredKinds requireGpu resizeCamera retry_ms retryAfter_ms rotateLeft rotateRight runNow screenCenter setCamera setLimit
  setRequests showElement showsAt slots startInertia startTick ticket transient transitionCamera uncovered unwrap urgency winds zoomToRect
`
  .trim()
  .split(/\s+/);
/** Names of members that only one entry, or the page, uses, and no public type has: they get short names, too. `checkOwnNames` fails where another folder uses one. */
const OWN_NAMES = `
  allHidden boxIn createContainer createTarget describeArea describeLine describeProfile fillIn findFolders formatSample hasHaze headings insecure
  isReady isStale notGeoreferenced partHidden restyle savePage selectId setCourse setFocus setLayer updateHeight
`
  .trim()
  .split(/\s+/);
const MANGLED = [...INTERNAL_NAMES, ...OWN_NAMES];
const mangleCache = Object.fromEntries(MANGLED.map((name, k) => [name, `_${k.toString(36)}`]));
const shared = {
  mangleProps: new RegExp(`^(?:${MANGLED.join("|")})$`),
  mangleCache,
  bundle: true,
  minify: true,
  target: "es2022",
  legalComments: "none",
  logLevel: "warning",
};
const CSS_TARGET = ["chrome111", "firefox121", "safari16.4"];
const banner = { js: "/*! map3d, Apache-2.0 */" };

/** Names of lower-case letters and digits only: texts with fewer different characters compress better. */
const lowerCaseNames = {
  get(n) {
    const letters = "etianorsdlcpmuhfgbvywkxqjz";
    const rest = `${letters}0123456789`;
    let name = letters[n % letters.length];
    for (let k = Math.floor(n / letters.length); k > 0; k = Math.floor((k - 1) / rest.length)) name += rest[(k - 1) % rest.length];
    return name;
  },
};

/** Shortens a bundle of esbuild by another 2 %. The result is ASCII: a page or server that declares no encoding reads the same texts. */
async function shorten(code, module) {
  const { code: shorter } = await minify(code, {
    ecma: 2022,
    module,
    compress: { passes: 5, keep_fargs: false, unsafe: true, unsafe_arrows: true, pure_getters: true, inline: 1 },
    mangle: { nth_identifier: lowerCaseNames },
    format: { ascii_only: true },
  });
  return shorter;
}

/** Folders of the core below src. */
const CORE = ["core", "geo", "tiles", "draw", "map", "overlay", "ui"];

/** @throws Error when an entry or the page uses an internal name of the core */
function checkInternalNames() {
  for (const folder of ["src", "page"]) {
    for (const file of readdirSync(join(root, folder), { recursive: true }).filter(
      (name) => name.endsWith(".ts") && !(folder === "src" && CORE.includes(name.split(/[/\\]/)[0])),
    )) {
      const found = readFileSync(join(root, folder, file), "utf8")
        .match(/\w+/g)
        ?.find((word) => INTERNAL_NAMES.includes(word));
      if (found !== undefined)
        throw new Error(
          `${folder}/${file}: uses "${found}", which is an internal name of the core; remove it from INTERNAL_NAMES in scripts/build.mjs`,
        );
    }
  }
}

/** @throws Error when two folders use an own name of one of them */
function checkOwnNames() {
  const files = ["src", "page"].flatMap((folder) =>
    readdirSync(join(root, folder), { recursive: true })
      .filter((name) => name.endsWith(".ts"))
      .map((name) => join(folder, name)),
  );
  for (const name of OWN_NAMES) {
    const users = new Set(
      files
        .filter((file) => new RegExp(`\\b${name}\\b`).test(readFileSync(join(root, file), "utf8")))
        .map((file) =>
          file
            .split(/[/\\]/)
            .slice(0, file.startsWith("page") ? 1 : 2)
            .join("/"),
        ),
    );
    if (users.size > 1)
      throw new Error(
        `${[...users].join(", ")}: use "${name}", which is to be a name of one of them; remove it from OWN_NAMES in scripts/build.mjs`,
      );
  }
}

/** Resolves `import code from "worker:./x.ts"` to the bundled source of a worker. */
const workers = {
  name: "workers",
  setup(build) {
    build.onResolve({ filter: /^worker:/ }, ({ path, resolveDir }) => ({
      path: resolve(resolveDir, path.slice("worker:".length)),
      namespace: "worker",
    }));
    build.onLoad({ filter: /.*/, namespace: "worker" }, async ({ path }) => {
      const result = await esbuild.build({ ...shared, entryPoints: [path], format: "iife", write: false, metafile: true });
      const watchFiles = Object.keys(result.metafile.inputs).map((file) => resolve(file));
      return { contents: await shorten(result.outputFiles[0].text, false), loader: "text", watchFiles };
    });
  },
};

/** Removes comments, indentation and the spaces around operators from a line of a shader; a macro keeps its spaces. */
const shortenLine = (line) =>
  line.startsWith("#") || line.includes('"')
    ? line
    : line.replace(/ *([=*/<>,;?:{}()&|]|[-+]=) */g, "$1").replace(/(?<=[\w)\]]) ([-+]) (?=[\w(])/g, "$1");

/** Names of functions and variables that a shader declares; not those of uniforms and outputs (u_…, o_…), which TypeScript code knows, and not those that hide a function of GLSL. */
const DECLARED =
  /\b(?:void|bool|u?int|float|[biu]?vec[234]|mat[234])\s+(?![a-z]_|main\b|step\b|distance\b|length\b|texture\b)([A-Za-z]\w+)/g;

/** Further names of a declaration with several variables. */
const ALSO_DECLARED = /(?<=\b(?:float|int|[biu]?vec[234]) [^;{}]*, ?)(?!step\b|distance\b|length\b|texture\b)([A-Za-z]\w+)(?= ?=[^=])/g;

/** Gives the names that shaders declare one or two letters each, and joins lines after statements; texts in `code` between backticks are shaders. */
function shortenNames(code) {
  const parts = code.split("`");
  const shaders = parts
    .filter((_, k) => k % 2 === 1)
    .join("\n")
    .replace(/\$\{[^}]*\}/g, "");
  const taken = new Set(["do", "if", "in", ...(shaders.match(/\b[A-Za-z]\w?\b/g) ?? [])]);
  const free = [..."abcdefghijklmnopqrstuvwxyz"]
    .flatMap((letter, _, all) => [letter, ...all.map((second) => letter + second)])
    .sort((a, b) => a.length - b.length);
  const names = new Map();
  const declared = [...shaders.matchAll(DECLARED), ...shaders.matchAll(ALSO_DECLARED)].map(([, name]) => name);
  for (const name of declared)
    if (!names.has(name))
      names.set(
        name,
        free.find((short) => !taken.has(short) && taken.add(short)),
      );
  const rename = (text) =>
    text.replace(/(\$\{[^}]*\})|(?<![.\w])[A-Za-z]\w+/g, (word, inserted) => (inserted === undefined ? (names.get(word) ?? word) : word));
  return parts.map((part, k) => (k % 2 === 1 ? rename(part).replace(/^(?!#)(.*[;{}])\n(?!#)/gm, "$1") : part)).join("`");
}

/** Shortens shaders. */
const shaders = {
  name: "shaders",
  setup(build) {
    build.onLoad({ filter: /\/shaders?\.ts$/ }, ({ path }) => ({
      contents: shortenNames(
        readFileSync(path, "utf8")
          .replace(/\/\*[^]*?\*\/|\/\/.*|^[ \t]+/gm, "")
          .replace(/\n{2,}/g, "\n")
          .split("\n")
          .map(shortenLine)
          .join("\n"),
      ),
      loader: "ts",
    }));
  },
};

/** Minifies the style sheets in template strings. */
const styles = {
  name: "styles",
  setup(build) {
    build.onLoad({ filter: /\/(styles|panelButton|elementContent)\.ts$/ }, async ({ path }) => {
      const text = readFileSync(path, "utf8");
      const [whole, before, css] = /(STYLES = )css`([^`$]*)`/.exec(text) ?? [];
      if (whole === undefined) throw new Error(`${path}: expected STYLES = css\`…\` without expressions`);
      const { code } = await esbuild.transform(css, { loader: "css", minify: true, target: CSS_TARGET });
      return {
        contents: text.replace(/^import \{ css \}.*\n/m, "").replace(whole, () => before + JSON.stringify(code.trim())),
        loader: "ts",
      };
    });
  },
};
/** Lets unused tables of suncalc, those of the moon, be dropped. */
const tables = {
  name: "tables",
  setup(build) {
    build.onLoad({ filter: /\/suncalc\/index\.js$/ }, ({ path }) => ({
      contents: readFileSync(path, "utf8").replaceAll("new Int32Array(", "/* @__PURE__ */ new Int32Array("),
      loader: "js",
    }));
  },
};
/** Reads a table of messages in page/i18n.ts: the text of an object. */
const readTable = (body) => new Function(`return ${body}`)();
const pageMessages = readFileSync(join(root, "page/i18n.ts"), "utf8");
/** Short names of keys of messages in mixed case, which are nothing else where they stand in quotation marks; not those that the page puts together, or reads from data. */
const SHORT_KEYS = new Map(
  Object.keys(readTable(/^const EN = (\{[^]*?^\});/m.exec(pageMessages)[1]))
    .filter((key) => /[A-Z]/.test(key) && !/Hint$|^measuredHeight$/.test(key))
    .map((key, k) => [key, k.toString(36)]),
);
const shortenKeys = (text) => text.replace(/"(\w+)"/g, (whole, key) => (SHORT_KEYS.has(key) ? `"${SHORT_KEYS.get(key)}"` : whole));

/** Writes the keys of the page's messages once for all languages, and shortens them. */
const messages = {
  name: "messages",
  setup(build) {
    build.onLoad({ filter: /\/page\/[\w-]+\.ts$/ }, ({ path }) => {
      if (!path.endsWith("/i18n.ts")) return { contents: shortenKeys(readFileSync(path, "utf8")), loader: "ts" };
      const join = (texts) => {
        if (texts.some((text) => text.includes("|"))) throw new Error(`${path}: a message contains "|"`);
        return JSON.stringify(texts.join("|"));
      };
      const keys = [];
      const contents = pageMessages.replace(/^(const (?:EN|DE|FR)(?:: Messages)? = )(\{[^]*?^\});/gm, (_, before, body) => {
        const table = readTable(body);
        if (keys.length === 0) keys.push(...Object.keys(table));
        return `${before}readMessages(${join(keys.map((key) => table[key]))});`;
      });
      return {
        contents: `const KEYS = ${join(keys.map((key) => SHORT_KEYS.get(key) ?? key))}.split("|");\nconst readMessages = (texts) => Object.fromEntries(texts.split("|").map((text, k) => [KEYS[k], text]));\n${contents}`,
        loader: "ts",
      };
    });
  },
};
const plugins = [workers, shaders, styles, tables, messages];

/** Lets entries import the core's public names: modules from map3d.module.js, scripts from the global `map3d`. */
const coreAs = (how) => ({
  name: "core",
  setup(build) {
    build.onResolve({ filter: /\/map3d$/ }, () =>
      how === "module" ? { path: "./map3d.module.js", external: true } : { path: "map3d", namespace: "global" },
    );
    build.onLoad({ filter: /.*/, namespace: "global" }, () => ({ contents: "module.exports = map3d;", loader: "js" }));
  },
});

async function bundle(entry, name, options) {
  await write({ ...shared, banner, entryPoints: [join(root, entry)], outfile: join(dist, name), plugins, ...options });
}

async function write(options) {
  const {
    outputFiles: [file],
  } = await esbuild.build({ ...options, write: false });
  writeFileSync(options.outfile, `${banner.js}\n${(await shorten(file.text, options.format === "esm")).replace(banner.js, "").trim()}\n`);
}

/** Writes a script that assigns the exports of a module to the global `map3d`, without the code that esbuild adds for live bindings. @param file the module, which imports nothing */
function writeScript(file, name) {
  const module = readFileSync(join(dist, file), "utf8").replace(banner.js, "").trim();
  const [end, list] = /export\{([^}]*)\};?\s*$/.exec(module) ?? [];
  if (end === undefined || module.startsWith("import"))
    throw new Error(`${file}: expected a module without imports that ends with its exports`);
  const exports = list.split(",").map((entry) => entry.split(" as ").reverse().join(":"));
  writeFileSync(
    join(dist, name),
    `${banner.js}\nvar map3d=(()=>{"use strict";${module.slice(0, -end.length)}return{${exports.join(",")}}})();\n`,
  );
}

/** Builds one file with the core and all entries. */
async function bundleFull(name, options) {
  const contents = ["src/map3d.ts", ...Object.values(ENTRIES)].map((file) => `export * from "./${file}";\n`).join("");
  await write({ ...shared, banner, stdin: { contents, resolveDir: root }, outfile: join(dist, name), plugins, ...options });
}

async function build() {
  rmSync(dist, { recursive: true, force: true });
  mkdirSync(dist, { recursive: true });
  checkInternalNames();
  checkOwnNames();
  const core = [...MODULE_ORDER.map((file) => `import "./src/${file}";\n`), 'export * from "./src/map3d.ts";\n'].join("");
  await write({
    ...shared,
    banner,
    stdin: { contents: core, resolveDir: root },
    outfile: join(dist, "map3d.module.js"),
    plugins,
    format: "esm",
  });
  writeScript("map3d.module.js", "map3d.js");
  for (const [name, entry] of Object.entries(ENTRIES)) {
    await bundle(entry, `map3d-${name}.module.js`, { format: "esm", plugins: [coreAs("module"), ...plugins] });
    await bundle(entry, `map3d-${name}.js`, {
      format: "iife",
      plugins: [coreAs("global"), ...plugins],
      globalName: "entry",
      banner: { js: `${banner.js}\n(() => {` },
      footer: { js: "Object.assign(map3d, entry);\n})();" },
    });
  }
  await bundle("src/offline/worker.ts", "map3d-worker.js", { format: "iife" });
  await bundleFull("map3d-full.module.js", { format: "esm" });
  writeScript("map3d-full.module.js", "map3d-full.js");
  await bundle("page/page-share.ts", "page-share.js", { format: "esm" });
  await bundle("page/page.ts", "page.js", {
    format: "esm",
    external: ["./map3d.module.js", "./page-share.js", ...Object.keys(ENTRIES).map((name) => `./map3d-${name}.module.js`)],
  });
  await esbuild.build({
    ...shared,
    entryPoints: [join(root, "page/start.js")],
    outfile: join(dist, "start.js"),
    target: "es5",
    charset: "ascii",
  });
  await esbuild.build({ ...shared, entryPoints: [join(root, "page/page.css")], outfile: join(dist, "page.css"), target: CSS_TARGET });
  writeFileSync(join(dist, "index.html"), minifyHtml(readFileSync(join(root, "page/index.html"), "utf8")));
  const tsc = join(root, "node_modules/typescript/bin/tsc");
  execFileSync(process.execPath, [tsc, "-p", join(root, "tsconfig.types.json")], { stdio: "inherit" });
  writeDeclarations();
}

/** Removes the English texts that the script replaces, indentation, line ends before blocks, and the end tags and quotation marks that HTML does not need. */
function minifyHtml(page) {
  const untranslated = page
    .replace(/(?<= data-i18n(?:-\w+)?=)"\w+"/g, shortenKeys)
    .replace(/(<[^>]* data-i18n="[^>]*>)[^<]+/g, "$1")
    .replace(/<[^>]* data-i18n-(?:label|placeholder)="[^>]*>/g, (tag) => tag.replace(/ (?:aria-label|placeholder)="[^"]*"/g, ""));
  const blocks = untranslated
    .replace(/^\s+/gm, "")
    .replace(/>\n(?=<(?:meta|link|title|script|p|div|form|dialog|ul|header|main|aside|section|h1|h2)\b)/g, ">")
    .replace(/<\/(?:li|option)>/g, "");
  return blocks.replace(/<[^>]*>/g, (tag) => tag.replace(/="([\w.#-]+)"(?=[ >])/g, "=$1"));
}

/** Writes the declarations, with file extensions in imports for all kinds of module resolution. */
function writeDeclarations() {
  const types = join(dist, "types");
  for (const file of readdirSync(types, { recursive: true }).filter((name) => name.endsWith(".d.ts"))) {
    const text = readFileSync(join(types, file), "utf8");
    writeFileSync(join(types, file), text.replace(/((?:from|import) ?\(?")(\.[^"]+)"/g, '$1$2.js"'));
  }
  const lines = Object.keys(ENTRIES).map((name) => `export * from "./types/${name}/index.js";\n`);
  const core = 'export * from "./types/map3d.js";\n';
  const global = "export as namespace map3d;\n";
  Object.keys(ENTRIES).forEach((name, k) => {
    writeFileSync(join(dist, `map3d-${name}.module.d.ts`), lines[k]);
  });
  writeFileSync(join(dist, "map3d.module.d.ts"), core);
  writeFileSync(join(dist, "map3d.d.ts"), core + global);
  writeFileSync(join(dist, "map3d-full.module.d.ts"), core + lines.join(""));
  writeFileSync(join(dist, "map3d-full.d.ts"), core + lines.join("") + global);
}

await build();
