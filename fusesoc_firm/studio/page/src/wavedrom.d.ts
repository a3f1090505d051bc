declare module "*wavedrom/lib/render-any.js" {
  const renderAny: (index: number, source: object, skin: object) => unknown;
  export default renderAny;
}
declare module "*wavedrom/skins/default.js" {
  const skin: object;
  export default skin;
}
declare module "onml/stringify.js" {
  const stringify: (tree: unknown) => string;
  export default stringify;
}
