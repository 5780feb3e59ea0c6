import { asError } from "../core/errors";
import { MapLayer, type ImageLayer, type Map3D } from "../map3d";
import { checkExpression, type FilterExpression } from "./expression";
import { findObjects } from "./findObjects";

/** Options of `filter`. */
export interface FilterOptions {
  /** How objects that do not fulfil the expression are shown. Default "dimmed". */
  others?: "dimmed" | "hidden";
}

/** Events of `filter`. */
export interface FilterEvents {
  /** The objects that fulfil the expression are shown. */
  change: { ids: readonly number[] };
  /** The attributes cannot be read. The map fires "error", too. */
  error: { error: Error };
}

/** Shows only the objects of a layer that fulfil an expression. Replaces the layer's style. */
export class Filter extends MapLayer<Map3D, FilterEvents> {
  readonly options: Required<FilterOptions>;
  readonly #layer: ImageLayer;
  #expression: FilterExpression;

  /** @throws UsageError for a wrong expression */
  constructor(layer: ImageLayer, expression: FilterExpression, options: FilterOptions = {}) {
    super();
    checkExpression(expression);
    this.options = { others: "dimmed", ...options };
    [this.#layer, this.#expression] = [layer, expression];
  }

  protected override get eventTypes(): readonly (keyof FilterEvents)[] {
    return ["change", "error"];
  }

  /** Sets another expression. @throws UsageError for a wrong one */
  setExpression(expression: FilterExpression): this {
    checkExpression(expression);
    this.#expression = expression;
    if (this.map) this.#apply(this.map);
    return this;
  }

  protected onAdd(map: Map3D): void {
    this.#apply(map);
  }

  protected onRemove(): void {
    this.#layer.setStyle({});
  }

  #apply(map: Map3D): void {
    const expression = this.#expression;
    findObjects(this.#layer, expression)
      .then((ids) => {
        if (this.map !== map || this.#expression !== expression) return;
        this.#layer.setStyle({ only: ids, others: this.options.others, descendants: false }); // columns have inherited values
        this.fire("change", { ids });
      })
      .catch((reason: unknown) => {
        if (this.map !== map) return;
        this.fire("error", { error: asError(reason) });
        map.report(asError(reason));
      });
  }
}
