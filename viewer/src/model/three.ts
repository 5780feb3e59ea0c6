/** What is used of three.js: any build since r155 has it, and the page's own types stay whatever they are. */
export interface Three {
  readonly REVISION: string;
  readonly LoopOnce: number;
  readonly LoopRepeat: number;
  readonly WebGLRenderer: new (options: { canvas: HTMLCanvasElement; context: WebGL2RenderingContext }) => ThreeRenderer;
  readonly WebGLRenderTarget: new (width: number, height: number, options: { samples: number; colorSpace: "srgb"; depthTexture: never }) => ThreeTarget;
  readonly DepthTexture: new (width: number, height: number) => object;
  readonly Scene: new () => ThreeNode;
  readonly Group: new () => ThreeNode;
  readonly Object3D: new () => ThreeNode;
  readonly OrthographicCamera: new () => ThreeCamera;
  readonly AmbientLight: new () => Lamp;
  readonly DirectionalLight: new () => Lamp;
  readonly Vector3: new (x: number, y: number, z: number) => Vector;
  readonly Box3: new () => Box;
  readonly Raycaster: new () => ThreeRaycaster;
  readonly AnimationMixer: new (root: never) => Mixer;
}

export interface Vector {
  readonly x: number;
  readonly y: number;
  readonly z: number;
  set(x: number, y: number, z: number): unknown;
}

/** An Object3D. */
export interface ThreeNode {
  readonly position: Vector;
  readonly rotation: { set(x: number, y: number, z: number, order: "ZYX"): unknown };
  readonly scale: Vector;
  readonly parent: ThreeNode | null;
  readonly animations: readonly ThreeClip[];
  visible: boolean;
  frustumCulled: boolean;
  add(node: ThreeNode): unknown;
  remove(node: ThreeNode): unknown;
  traverse(visit: (node: ThreeNode) => void): void;
}

export interface Lamp extends ThreeNode {
  readonly color: { setRGB(r: number, g: number, b: number): unknown };
  intensity: number;
}

/** An AnimationClip. */
export interface ThreeClip {
  readonly name: string;
}

/** An OrthographicCamera. */
export interface ThreeCamera extends ThreeNode {
  left: number;
  right: number;
  top: number;
  bottom: number;
  near: number;
  far: number;
  matrixAutoUpdate: boolean;
  readonly matrix: { set(...rows: readonly [number, number, number, number, number, number, number, number, number, number, number, number, number, number, number, number]): unknown };
  updateProjectionMatrix(): void;
}

/** A WebGLRenderTarget. */
export interface ThreeTarget {
  readonly width: number;
  readonly height: number;
  readonly texture: object;
  readonly depthTexture: object | null;
  dispose(): void;
}

/** A WebGLRenderer. */
export interface ThreeRenderer {
  /** `__webglTexture` of a texture that has been drawn to. */
  readonly properties: { get(texture: object): unknown };
  setClearColor(color: number, alpha: number): void;
  setRenderTarget(target: ThreeTarget | null): void;
  render(scene: never, camera: never): void;
  resetState(): void;
  dispose(): void;
}

export interface Box {
  readonly min: Vector;
  readonly max: Vector;
  setFromObject(node: ThreeNode): unknown;
  isEmpty(): boolean;
}

/** An intersection, as a Raycaster finds it. */
export interface ThreeHit {
  readonly object: ThreeNode;
  readonly point: Vector;
}

/** A Raycaster. */
export interface ThreeRaycaster {
  readonly params: { readonly Line: { threshold: number }; readonly Points: { threshold: number } };
  camera: unknown;
  set(origin: Vector, direction: Vector): void;
  intersectObjects(nodes: ThreeNode[], recursive: boolean): readonly ThreeHit[];
}

export interface Mixer {
  clipAction(clip: ThreeClip): Action;
  update(seconds: number): unknown;
}

export interface Action {
  clampWhenFinished: boolean;
  reset(): Action;
  setLoop(mode: never, repetitions: number): Action;
  play(): Action;
  stop(): Action;
  isRunning(): boolean;
}

/** GLTFLoader, or any other of three.js. */
export interface ModelLoader {
  /** An Object3D, or `{ scene, animations }`. */
  loadAsync(url: string): Promise<unknown>;
}
