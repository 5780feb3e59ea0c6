// Serves cities, their 3D Tiles, the pages and the peers' libraries on a free port like a static host: gzip for text and geometry, range requests, keep-alive.
// Counts requests and sent bytes, headers included.
import { open, readFile, stat } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { gzipSync } from "node:zlib";
import { PMTiles } from "../../viewer/node_modules/pmtiles/dist/esm/index.js";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".mjs": "text/javascript", ".css": "text/css", ".json": "application/json", ".wasm": "application/wasm", ".glb": "model/gltf-binary", ".png": "image/png", ".jpg": "image/jpeg", ".svg": "image/svg+xml" };
const ZIPPED = new Set([".html", ".js", ".mjs", ".css", ".json", ".wasm", ".glb", ".svg"]);

export class Server {
  #server = createServer((request, response) => { void this.#handle(request, response); });
  #sockets = new Set();
  #closedBytes = 0;
  #zipped = new Map();
  #archives = new Map();
  /** Requested paths that do not exist. */
  missing = [];
  requests = [];

  /** @param roots folder by first part of the path */
  constructor(work, roots) {
    this.work = work;
    this.roots = roots;
    this.#server.on("connection", (socket) => {
      this.#sockets.add(socket);
      socket.on("close", () => {
        this.#sockets.delete(socket);
        this.#closedBytes += socket.bytesWritten;
      });
    });
  }

  async listen() {
    await new Promise((done) => this.#server.listen(0, "127.0.0.1", done));
    this.origin = `http://127.0.0.1:${this.#server.address().port}`;
  }

  close() {
    this.#server.closeAllConnections();
    this.#server.close();
  }

  /** Requests and sent bytes so far. */
  get count() {
    return { requests: this.requests.length, bytes: [...this.#sockets].reduce((sum, { bytesWritten }) => sum + bytesWritten, this.#closedBytes) };
  }

  async #handle(request, response) {
    const path = decodeURIComponent(new URL(request.url, "http://host").pathname);
    this.requests.push(path);
    try {
      const [, root, ...rest] = normalize(path).split("/");
      if (root === "plain") await this.#serveTile(rest, response);
      else await this.#file(this.#filePath(root, rest), request, response);
    } catch (reason) {
      if (reason.code !== "ENOENT") console.error(`bench: ${path}: ${reason.stack}`);
      this.missing.push(path);
      response.writeHead(404).end();
    }
  }

  /** Returns the file of a path. Each cell of a city has its own URLs for the files of its district. */
  #filePath(root, rest) {
    const folder = this.roots[root];
    if (!folder) throw Object.assign(new Error(`no ${root}`), { code: "ENOENT" });
    return join(folder, ...(root === "3dtiles" && rest[0].startsWith("place-") ? rest.slice(1) : rest));
  }

  async #file(path, request, response) {
    const kind = extname(path);
    const head = { "content-type": TYPES[kind] ?? "application/octet-stream", "cache-control": "max-age=3600" };
    const range = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? "");
    if (range) {
      const [from, to, size] = [Number(range[1]), Number(range[2]), (await stat(path)).size];
      const file = await open(path);
      const bytes = Buffer.alloc(Math.min(to, size - 1) - from + 1);
      await file.read(bytes, 0, bytes.length, from);
      await file.close();
      response.writeHead(206, { ...head, "content-length": bytes.length, "content-range": `bytes ${from}-${from + bytes.length - 1}/${size}`, etag: `"${size}"` }).end(bytes);
    } else if (ZIPPED.has(kind)) {
      if (!this.#zipped.has(path)) this.#zipped.set(path, gzipSync(await readFile(path), { level: 9 }));
      const bytes = this.#zipped.get(path);
      response.writeHead(200, { ...head, "content-length": bytes.length, "content-encoding": "gzip" }).end(bytes);
    } else {
      const bytes = await readFile(path);
      response.writeHead(200, { ...head, "content-length": bytes.length }).end(bytes);
    }
  }

  /** Serves a published city as single tiles: /plain/CITY/rendering.json and /plain/CITY/VIEW/LAYER/Z/X/Y. */
  async #serveTile([city, ...rest], response) {
    const folder = join(this.work, "published", city);
    const manifest = JSON.parse(await readFile(join(folder, "rendering.json"), "utf8"));
    if (rest[0] === "rendering.json") {
      for (const view of manifest.views) delete view.archives;
      const bytes = gzipSync(JSON.stringify(manifest));
      response.writeHead(200, { "content-type": "application/json", "content-encoding": "gzip", "content-length": bytes.length }).end(bytes);
      return;
    }
    const [view, layer, ...tile] = rest;
    const archive = join(folder, manifest.views.find(({ id }) => id === view).archives[layer]);
    if (!this.#archives.has(archive)) this.#archives.set(archive, new PMTiles(new FileSource(archive)));
    const found = await this.#archives.get(archive).getZxy(...tile.map(Number));
    if (!found) response.writeHead(204).end();
    else response.writeHead(200, { "content-type": manifest.layers.find(({ name }) => name === layer).media_type, "content-length": found.data.byteLength, "cache-control": "max-age=3600" }).end(Buffer.from(found.data));
  }
}

class FileSource {
  constructor(path) {
    this.path = path;
  }

  getKey() {
    return this.path;
  }

  async getBytes(offset, length) {
    this.file ??= await open(this.path);
    const bytes = Buffer.alloc(length);
    const { bytesRead } = await this.file.read(bytes, 0, length, offset);
    return { data: bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytesRead) };
  }
}
