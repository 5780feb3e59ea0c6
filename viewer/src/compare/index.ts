/** map3d-compare: compares renderings with a swipe divider, a time slider, or maps that move together. */
export { swipe, swipe as Swipe, type Layers, type SwipeEvents, type SwipeOptions } from "./swipe";
export { epochs, epochs as Epochs, type Epoch, type EpochsEvents, type EpochsOptions } from "./epochs";
export { sync, sync as Sync, type SyncEvents, type SyncOptions } from "./sync";
