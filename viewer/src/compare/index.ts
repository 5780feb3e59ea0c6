/** map3d-compare: compares renderings with a swipe divider or a time slider. */
export { swipe, swipe as Swipe, type Layers, type SwipeEvents, type SwipeOptions } from "./swipe";
export { epochs, epochs as Epochs, type Epoch, type EpochsEvents, type EpochsOptions } from "./epochs";
