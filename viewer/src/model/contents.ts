import { UsageError } from "../map3d";
import type { Clip, Node } from "./three";

/** A model: what stands in the scene, and how it can move. */
export interface Contents {
  readonly object: Node;
  readonly clips: readonly Clip[];
}

const isNode = (value: unknown): value is Node => typeof value === "object" && value !== null && (value as { isObject3D?: unknown }).isObject3D === true;

/** Of an Object3D, or of what GLTFLoader makes: `{ scene, animations }`. @throws UsageError for anything else */
export function contentsOf(made: unknown, name: string): Contents {
  if (isNode(made)) return prepared(made, made.animations);
  const { scene, animations = [] } = (made ?? {}) as { scene?: unknown; animations?: readonly Clip[] };
  if (!isNode(scene)) throw new UsageError(`${name} is neither a three.js Object3D nor { scene, animations }`);
  return prepared(scene, animations);
}

/** A mesh, as far as its belongings can be freed. */
interface Belongings {
  readonly isSkinnedMesh?: boolean;
  readonly isInstancedMesh?: boolean;
  readonly geometry?: Disposable;
  readonly material?: Material | readonly Material[];
  readonly skeleton?: Disposable;
  dispose?(): void;
}

interface Disposable {
  dispose(): void;
}

interface Material extends Disposable {
  transparent: boolean;
  depthWrite: boolean;
}

const materialsOf = ({ material }: Belongings): readonly Material[] => (material ? [material].flat<(Material | readonly Material[])[]>() : []);

/** Does a mesh follow bones, so that its box is not known beforehand? */
export const isBoned = (node: Node): boolean => (node as Belongings).isSkinnedMesh === true;

/** Glass needs a depth, too: without one it could not be told whether a building stands before it. */
function prepared(object: Node, clips: readonly Clip[]): Contents {
  object.traverse((node) => {
    for (const material of materialsOf(node as Belongings)) if (material.transparent) material.depthWrite = true;
    if (isBoned(node)) node.frustumCulled = false;
  });
  return { object, clips };
}

/** Gives back what the GPU holds of an object; shown again, it is uploaded again. */
export function freed(object: Node): void {
  object.traverse((node) => {
    const own = node as Belongings;
    own.geometry?.dispose();
    own.skeleton?.dispose();
    if (own.isInstancedMesh) own.dispose?.();
    for (const material of materialsOf(own)) {
      for (const value of Object.values(material) as unknown[]) if ((value as { isTexture?: boolean } | null)?.isTexture) (value as Disposable).dispose();
      material.dispose();
    }
  });
}
