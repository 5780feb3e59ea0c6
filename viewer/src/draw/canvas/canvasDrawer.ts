import type { Tile } from "../../geo/frame";
import type { LayerKind } from "../../geo/manifest";
import { standsFor } from "../../tiles/cover";
import { neededKinds, type Drawer, type DrawerEvents, type FrameSpec, type Pass, type Quad } from "../drawer";
import { meet } from "../combine";
import type { DrawStyles } from "../drawStyle";
import { kindsBeside, kindsOf, lookOf, lookWith, type Look } from "./look";
import { maskOf, type Mask } from "./mask";
import { Pictures, type Image, type Picture, type Wish } from "./pictures";
import type { Order } from "./shade.worker";
import { areaOf, gridOf, type Grid, type Piece } from "./sheet";
import { Laid, Painted, type Showing, type Shown } from "./showing";

type Named = Pass["highlight"] | DrawStyles;

/** A tile that is to be seen. */
interface Wanted {
  readonly from: Tile;
  readonly look: Look;
  readonly layers: Order["layers"];
  /** From the middle of the screen, device pixels. */
  readonly far: number;
}

/** Draws on a 2D canvas. A worker makes the tiles' pictures; what is not made yet is stood in for by what is. */
export class CanvasDrawer implements Drawer {
  readonly name = "canvas";
  readonly gl = null;
  readonly #showing: Showing;
  readonly #pictures: Pictures;
  /** Data that the worker has, and the picture it is for. */
  readonly #given = new Map<string, Picture>();
  /** Highlights and finishes that the worker has, and their names. */
  readonly #named = new Map<Named, string>();
  #tilePx = 0;
  #names = 0;

  /** @param preserve the canvas itself is painted, so that its pixels can be read  @throws DrawError when the canvas has another context already, or the browser no 2D canvas */
  constructor(canvas: HTMLCanvasElement, preserve: boolean, events: DrawerEvents) {
    this.#showing = new (preserve ? Painted : Laid)(canvas, () => { events.changed(); });
    this.#pictures = new Pictures({ made: () => { events.changed(); }, failed: (error) => { events.failed(error); } });
  }

  get busy(): boolean {
    return this.#pictures.busy;
  }

  get note(): string {
    return this.#pictures.composed ? "light by compositing: this browser changes pixels that are read" : "";
  }

  get element(): HTMLElement {
    return this.#showing.element;
  }

  draw(frame: FrameSpec): void {
    const wanted = frame.passes.map((pass) => [pass, this.#giveAll(frame, pass)] as const);
    this.#showing.show(frame, wanted.flatMap(([pass, tiles]) => this.#shownOf(pass, tiles)));
    const wishes = wanted.flatMap(([pass, tiles]) => [...tiles].map(([name, tile]) => this.#wish(frame.passes, pass, this.#pictures.of(name), tile)));
    this.#pictures.want(wishes.filter(({ urgency }) => urgency.length > 0));
    this.#dropNamed(frame.passes);
    if (this.busy) return;
    const [seen, looks] = [new Set(wishes.map(({ picture }) => picture)), new Set(wishes.map(({ look }) => look))];
    this.#pictures.prune((picture) => !seen.has(picture) && !looks.has(picture.look));
  }

  release(key: string): void {
    const picture = this.#given.get(key);
    if (!picture) return;
    this.#given.delete(key);
    this.#pictures.drop(key);
    picture.parts.delete(key);
    if (picture.parts.size === 0) this.#pictures.forget(picture.name);
  }

  destroy(): void {
    this.#pictures.stop();
    this.#showing.remove();
    this.#given.clear();
  }

  /** Gives the worker what it has not. @returns the tiles that are to be seen, by the name of their picture */
  #giveAll(frame: FrameSpec, pass: Pass): Map<string, Wanted> {
    const names = { highlight: pass.highlight.size > 0 ? this.#nameOf(pass.highlight) : null, finish: pass.finishes && this.#nameOf(pass.finishes) };
    const wanted = new Map<string, Wanted>();
    for (const { from, rect, scale } of pass.quads) {
      const name = nameIn(pass, from);
      const far = Math.hypot((rect[0] + rect[2] - frame.width) / 2, (rect[1] + rect[3] - frame.height) / 2);
      const known = wanted.get(name);
      const look = known?.look ?? lookOf(frame, pass, scale, names);
      const layers = known?.layers ?? this.#give(pass, look, from);
      if (layers) wanted.set(name, { from, look, layers, far: Math.min(far, known?.far ?? far) });
    }
    return wanted;
  }

  /** Gives the worker a tile's data. @returns its names; null when there is nothing to show */
  #give(pass: Pass, look: Look, tile: Tile): Order["layers"] | null {
    const picture = this.#pictures.of(nameIn(pass, tile));
    const layers: Partial<Record<LayerKind, string>> = {};
    for (const kind of kindsOf(look)) {
      const key = pass.tiles.key(kind, tile);
      const data = this.#given.has(key) ? null : pass.tiles.data(kind, tile);
      if (data) {
        this.#tilePx = data.width;
        this.#pictures.put(key, data, "bitmap" in data ? [data.bitmap] : data.kind === "normal" ? [data.values.buffer] : []);
        this.#given.set(key, picture);
        picture.parts.add(key);
        pass.tiles.taken(kind, tile);
      }
      if (this.#given.has(key)) layers[kind] = key;
    }
    return neededKinds(look.mode, look.masked, look.combined).every((kind) => layers[kind] !== undefined) ? layers : null;
  }

  #shownOf(pass: Pass, wanted: ReadonlyMap<string, Wanted>): Shown[] {
    const { mode, opacity, clip, quads } = pass;
    const grid = gridOf(pass, this.#tilePx);
    if (!grid || this.#tilePx === 0) return [];
    const pieces = quads.filter(({ from }) => wanted.has(nameIn(pass, from))).flatMap((quad) => this.#piecesFor(pass, grid, quad));
    return pieces.length > 0 ? [{ grid, pieces, smooth: mode === "lit" || mode === "color" || mode === "picture", opacity, clip }] : [];
  }

  /** What stands for a quad: the picture of its tile, or of tiles below or above it that have one. */
  #piecesFor(pass: Pass, grid: Grid, { from, rect }: Quad): Piece[] {
    const area = areaOf(grid, rect);
    const shown = (tile: Tile): Image | undefined => this.#pictures.get(nameIn(pass, tile))?.image;
    const own = shown(from);
    if (own) return [{ area, from, image: own }];
    const stands = standsFor(area, (tile) => shown(tile) !== undefined, () => true, area.z > grid.level ? 0 : 2);
    return stands.map((stand) => ({ ...stand, image: shown(stand.from) as Image }));
  }

  /** One without urgency is fulfilled. */
  #wish(passes: readonly Pass[], pass: Pass, picture: Picture, { from, look, layers, far }: Wanted): Wish {
    const { tiles } = pass;
    const shown = { ...lookWith(look, (kind) => layers[kind] !== undefined), masks: this.#masksOver(passes, pass, from) };
    const beside: Partial<Record<LayerKind, string[]>> = {};
    let edges = 0;
    for (const [number, kind] of kindsBeside(shown).entries()) {
      const keys = BESIDE.map(([dx, dy]) => tiles.key(kind, { z: from.z, x: from.x + dx, y: from.y + dy }));
      keys.forEach((key, k) => (edges |= this.#given.has(key) ? 1 << (k + 4 * number) : 0));
      beside[kind] = keys;
    }
    const text = JSON.stringify(shown);
    return { picture, look: text, edges, order: { look: shown, layers, beside }, urgency: urgencyOf(picture, text, edges, far) };
  }

  /** Tiles of other layers that may hide parts of one of this. */
  #masksOver(passes: readonly Pass[], { depths, clip, tiles }: Pass, from: Tile): Mask[] {
    if (!depths) return [];
    const others = passes.filter((other) => other.tiles !== tiles && other.depths && other.opacity === 1 && meet(clip, other.clip));
    return others.flatMap((other) => {
      const above = new Map(other.quads.map((quad) => [other.tiles.key("depth", quad.from), quad.from]));
      return [...above].flatMap(([depth, tile]) => {
        const color = other.tiles.key(other.mode === "picture" ? "picture" : "color", tile);
        const mask = other.depths && this.#given.has(depth) ? maskOf(depths, from, other.depths, tile, { depth, color: other.masked || !this.#given.has(color) ? null : color }) : null;
        return mask ? [mask] : [];
      });
    });
  }

  #nameOf(said: Named): string {
    const known = this.#named.get(said);
    if (known !== undefined) return known;
    const name = `said ${String(this.#names++)}`;
    this.#pictures.put(name, said);
    this.#named.set(said, name);
    return name;
  }

  #dropNamed(passes: readonly Pass[]): void {
    for (const [said, name] of this.#named) {
      if (passes.some(({ highlight, finishes }) => highlight === said || finishes === said)) continue;
      this.#pictures.drop(name);
      this.#named.delete(said);
    }
  }
}

const BESIDE = [[-1, 0], [1, 0], [0, -1], [0, 1]] as const;

/** Name of a tile's picture, whatever it shows. */
const nameIn = ({ tiles, mode }: Pass, tile: Tile): string => tiles.key("color", tile) || tiles.key(mode === "lit" ? "color" : mode, tile);

/** First what has no picture, then what looks otherwise (the longest first), then edges; from the middle of the screen. */
function urgencyOf(picture: Picture, look: string, edges: number, far: number): number[] {
  if (picture.look !== look) return picture.image ? [1, picture.ticket, far] : [0, 0, far];
  return (edges & ~picture.edges) === 0 ? [] : [2, 0, far];
}
