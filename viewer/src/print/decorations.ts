import { SCALE_BAR_MAX_PX, formatLength, floorToRound } from "../core/lengths";
import type { Map3D } from "../map3d";

/** A legend; a `theme` has this shape. */
export interface PictureLegend {
  readonly title: string;
  readonly classes: readonly { readonly label: string; readonly color: string }[];
  /** The classes to show. Default: all. */
  readonly chosen?: PictureLegend["classes"];
}

const FONT = "system-ui, sans-serif";
const [INK, FAINT, PANEL, EDGE] = ["#26282b", "#5d6166", "rgb(255 255 255 / 0.92)", "rgb(38 40 43 / 0.18)"] as const;
const HALO = "rgb(255 255 255 / 0.9)";
/** CSS pixels. */
const [MARGIN, PAD, SWATCH, ROW] = [16, 12, 16, 24] as const;

interface MarkerPin {
  readonly x: number;
  readonly y: number;
  readonly label: string;
  readonly color: string;
}

/** Draws title, legend, scale bar, north arrow, markers and attribution over a picture. Lengths are CSS pixels, scaled by `unit`. */
export class Decorations {
  readonly #context: CanvasRenderingContext2D;
  readonly #unit: number;
  readonly #lookAt_deg: number;
  /** Metres across the picture per CSS pixel of text. */
  readonly #unit_m: number;
  readonly #markers: readonly MarkerPin[];
  readonly #width: number;
  readonly #height: number;

  /** Copies the current state of the map. @param scale picture pixels per CSS pixel of the map  @param unit picture pixels per CSS pixel of text */
  constructor(map: Map3D, context: CanvasRenderingContext2D, scale: number, unit: number) {
    [this.#context, this.#unit] = [context, unit];
    [this.#width, this.#height] = [context.canvas.width / unit, context.canvas.height / unit];
    this.#lookAt_deg = map.lookAt_deg;
    this.#unit_m = (map.metresPerPixel / scale) * unit;
    const accent = getComputedStyle(map.container).getPropertyValue("--map3d-accent") || INK;
    const toPicture = (at: number, mapSize: number, pictureSize: number): number => ((at - mapSize / 2) * scale) / unit + pictureSize / 2;
    this.#markers = map.markers.flatMap(({ label, position, options: { color = accent, showLabel } }) => {
      const at = position && map.project(position);
      return at
        ? [
            {
              x: toPicture(at[0], map.canvas.clientWidth, this.#width),
              y: toPicture(at[1], map.canvas.clientHeight, this.#height),
              label: showLabel ? label : "",
              color,
            },
          ]
        : [];
    });
  }

  /** Switches the canvas to CSS pixels. */
  begin(): this {
    this.#context.setTransform(this.#unit, 0, 0, this.#unit, 0, 0);
    this.#context.textBaseline = "middle";
    return this;
  }

  /** Draws the title in the top left corner. */
  title(text: string): void {
    const lines = this.#wrap(text, 18, 600, this.#width * 0.6);
    const width = Math.max(...lines.map((line) => this.#widthOf(line, 18, 600)));
    this.#panel(MARGIN, MARGIN, width + 2 * PAD, lines.length * ROW + PAD);
    lines.forEach((line, k) => this.#text(line, MARGIN + PAD, MARGIN + PAD / 2 + (k + 0.5) * ROW, 18, 600));
  }

  /** Draws legend, scale bar and attribution, from the bottom up. */
  footer(legend: PictureLegend | undefined, scaleBar: boolean, attribution: string): void {
    const height = this.#attribution(attribution, scaleBar ? SCALE_BAR_MAX_PX + 2 * MARGIN : MARGIN);
    if (scaleBar) this.#scaleBar(this.#height - MARGIN);
    if (legend) this.#legend(legend, this.#height - MARGIN - Math.max(height, scaleBar ? 24 : 0));
  }

  /** Draws the north arrow in the top right corner. */
  northArrow(): void {
    const context = this.#context;
    context.save();
    context.translate(this.#width - MARGIN - 22, MARGIN + 22);
    disc(context, 22);
    context.rotate((this.#lookAt_deg * Math.PI) / 180);
    for (const [tip, color] of [
      [-15, INK],
      [15, "#b9bcc0"],
    ] as const) {
      context.beginPath();
      context.moveTo(0, tip);
      context.lineTo(6, 0);
      context.lineTo(-6, 0);
      context.fillStyle = color;
      context.fill();
    }
    context.textAlign = "center";
    this.#text("N", 0, -4, 7, 700, "#fff");
    context.restore();
  }

  /** Draws the markers of the map. */
  markers(): void {
    for (const pin of this.#markers) if (pin.x >= 0 && pin.y >= 0 && pin.x <= this.#width && pin.y <= this.#height) this.#pin(pin);
  }

  #pin({ x, y, label, color }: MarkerPin): void {
    const context = this.#context;
    if (label !== "") {
      context.fillStyle = color;
      context.fillRect(x - 1, y - 24, 2, 18);
      const width = this.#widthOf(label, 13, 550) + 20;
      this.#panel(x - width / 2, y - 48, width, 24, 12);
      this.#text(label, x - width / 2 + 10, y - 36, 13, 550);
    }
    for (const [radius, fill] of [
      [6, "#fff"],
      [4, color],
    ] as const) {
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.fillStyle = fill;
      context.fill();
    }
  }

  /** @returns its height */
  #attribution(text: string, left: number): number {
    if (text === "") return 0;
    const lines = this.#wrap(text, 11, 400, this.#width - left - MARGIN);
    const width = Math.max(...lines.map((line) => this.#widthOf(line, 11, 400)));
    const height = lines.length * 15 + 6;
    this.#context.fillStyle = PANEL;
    this.#context.fillRect(this.#width - width - 16, this.#height - height, width + 16, height);
    this.#context.textAlign = "right";
    lines.forEach((line, k) => this.#text(line, this.#width - 8, this.#height - height + 3 + (k + 0.5) * 15, 11, 400, FAINT));
    this.#context.textAlign = "left";
    return height;
  }

  #scaleBar(bottom: number): void {
    const context = this.#context;
    const metres = floorToRound(Math.min(SCALE_BAR_MAX_PX, this.#width / 3) * this.#unit_m);
    const length = metres / this.#unit_m;
    context.beginPath();
    for (const [x, y] of [
      [0, -7],
      [0, 0],
      [length, 0],
      [length, -7],
    ] as const)
      context.lineTo(MARGIN + x, bottom + y);
    this.#strokeWithHalo(1.5);
    context.textAlign = "center";
    context.font = `500 12px ${FONT}`;
    [context.strokeStyle, context.lineWidth] = [HALO, 3];
    context.strokeText(formatLength(metres), MARGIN + length / 2, bottom - 9);
    this.#text(formatLength(metres), MARGIN + length / 2, bottom - 9, 12, 500);
    context.textAlign = "left";
  }

  #legend({ title, classes, chosen = classes }: PictureLegend, bottom: number): void {
    const labels = chosen.map(({ label }) => label);
    const width = Math.min(
      Math.max(this.#widthOf(title, 13, 600), ...labels.map((label) => this.#widthOf(label, 13, 400) + SWATCH + 9)),
      this.#width * 0.5,
    );
    const top = bottom - (chosen.length + 1) * ROW - PAD;
    this.#panel(MARGIN, top, width + 2 * PAD, bottom - top);
    this.#text(this.#truncate(title, 13, 600, width), MARGIN + PAD, top + PAD / 2 + ROW / 2, 13, 600);
    chosen.forEach(({ label, color }, k) => {
      const middle = top + PAD / 2 + (k + 1.5) * ROW;
      this.#context.fillStyle = color;
      this.#context.strokeStyle = EDGE;
      this.#context.lineWidth = 1;
      this.#context.beginPath();
      this.#context.roundRect(MARGIN + PAD, middle - SWATCH / 2, SWATCH, SWATCH, 4);
      this.#context.fill();
      this.#context.stroke();
      this.#text(this.#truncate(label, 13, 400, width - SWATCH - 9), MARGIN + PAD + SWATCH + 9, middle, 13, 400);
    });
  }

  #panel(x: number, y: number, width: number, height: number, radius = 8): void {
    const context = this.#context;
    context.beginPath();
    context.roundRect(x, y, width, height, radius);
    context.fillStyle = PANEL;
    context.fill();
    context.strokeStyle = EDGE;
    context.lineWidth = 0.75;
    context.stroke();
  }

  #text(text: string, x: number, y: number, size: number, weight: number, color: string = INK): void {
    this.#context.font = `${String(weight)} ${String(size)}px ${FONT}`;
    this.#context.fillStyle = color;
    this.#context.fillText(text, x, y);
  }

  /** Strokes the path as a dark line with a white outline. */
  #strokeWithHalo(width: number): void {
    const context = this.#context;
    context.lineJoin = "round";
    for (const [color, wide] of [
      [HALO, width + 3],
      [INK, width],
    ] as const) {
      [context.strokeStyle, context.lineWidth] = [color, wide];
      context.stroke();
    }
  }

  #widthOf(text: string, size: number, weight: number): number {
    this.#context.font = `${String(weight)} ${String(size)}px ${FONT}`;
    return this.#context.measureText(text).width;
  }

  #truncate(text: string, size: number, weight: number, width: number): string {
    if (this.#widthOf(text, size, weight) <= width) return text;
    const letters = Array.from(text);
    while (letters.length > 0 && this.#widthOf(`${letters.join("")}…`, size, weight) > width) letters.pop();
    return `${letters.join("")}…`;
  }

  #wrap(text: string, size: number, weight: number, width: number): string[] {
    const lines: string[] = [];
    for (const word of text.split(/\s+/)) {
      const longer = lines.length > 0 ? `${lines.at(-1) ?? ""} ${word}` : word;
      if (lines.length > 0 && this.#widthOf(longer, size, weight) <= width) lines[lines.length - 1] = longer;
      else lines.push(this.#truncate(word, size, weight, width));
    }
    return lines;
  }
}

function disc(context: CanvasRenderingContext2D, radius: number): void {
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  context.fillStyle = PANEL;
  context.fill();
  context.strokeStyle = EDGE;
  context.lineWidth = 0.75;
  context.stroke();
}
