// What is wrong with what is seen of the page: texts and handles that are too small, cut texts, covered controls.
((smallestText, smallestHandle) => {
  // Rounding by the browser, in pixels.
  const SLACK = 1;
  const boxOf = (item) => item.getBoundingClientRect();
  const common = (one, other) => ({
    left: Math.max(one.left, other.left),
    top: Math.max(one.top, other.top),
    right: Math.min(one.right, other.right),
    bottom: Math.min(one.bottom, other.bottom),
  });
  const isSeen = (box) => box.right - box.left > SLACK && box.bottom - box.top > SLACK;
  const styleOf = (item) => getComputedStyle(item);
  const named = (item) => `${item.tagName} ${item.getAttribute("class") ?? ""}: ${(item.ariaLabel ?? item.textContent).trim().slice(0, 40)}`;

  /** The elements around a node, from inside. */
  function around(node) {
    const found = [];
    for (let item = node.parentElement; item; item = item.parentElement) found.push(item);
    return found;
  }

  /** The part of a node's box that is seen. */
  function seen(node, box) {
    const clipping = around(node).filter((item) => styleOf(item).overflow !== "visible");
    return clipping.map(boxOf).reduce(common, common(box, { left: 0, top: 0, right: innerWidth, bottom: innerHeight }));
  }

  /** How much larger an element is on the screen than its style says. */
  function zoomOf(item) {
    if (item instanceof SVGGraphicsElement) return item.getScreenCTM().a;
    return [item, ...around(item)].reduce((zoom, at) => zoom * new DOMMatrix(styleOf(at).transform).a, 1);
  }

  /** Whether an element hides a part of a text without a way to scroll there; the picture is moved instead. */
  function isCut(node, box) {
    for (const item of around(node)) {
      const { overflowX, overflowY } = styleOf(item);
      if (item.matches(".svelte-flow, body") || [overflowX, overflowY].some((value) => ["auto", "scroll"].includes(value))) return false;
      const own = boxOf(item);
      if (overflowX !== "visible" && (box.left < own.left - SLACK || box.right > own.right + SLACK)) return true;
      // The box of a line is higher than its letters.
      if (overflowY !== "visible" && (box.top < own.top - 3 || box.bottom > own.bottom + 3)) return true;
    }
    return false;
  }

  const found = { small: [], handles: [], cut: [], over: [] };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const { currentNode: node } = texts;
    const item = node.parentElement;
    if (!node.textContent.trim() || !item.checkVisibility({ visibilityProperty: true, opacityProperty: true }) || item.matches("option, script, style")) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    if (!isSeen(seen(node, boxOf(range)))) continue;
    const size = parseFloat(styleOf(item).fontSize) * zoomOf(item);
    if (size < smallestText - 0.01) found.small.push(`${size} ${named(item)}`);
    if (isCut(node, boxOf(range))) found.cut.push(named(item));
  }

  const all = (selector) => [...document.querySelectorAll(selector)].filter((item) => item.checkVisibility());
  for (const handle of all(".svelte-flow__handle.connectable")) {
    const { width, height } = boxOf(handle);
    if (Math.min(width, height) < smallestHandle - 0.01) found.handles.push(`${width} ${named(handle.parentElement)}`);
  }
  if (document.documentElement.scrollWidth > innerWidth) found.cut.push("the page is wider than the window");
  const isOutside = ({ left, right }) => left < -SLACK || right > innerWidth + SLACK;
  found.cut.push(...all("header *, .run *, [role=group] *").filter((item) => isOutside(boxOf(item))).map(named));

  const covering = (items) => {
    const boxes = items.map((item) => [item, seen(item, boxOf(item))]).filter(([, box]) => isSeen(box));
    boxes.forEach(([one, box], index) => {
      for (const [other, second] of boxes.slice(index + 1)) {
        const isInside = one.contains(other) || other.contains(one);
        if (!isInside && isSeen(common(box, second))) found.over.push(`${named(one)} / ${named(other)}`);
      }
    });
  };
  // A dialog covers what is behind it.
  covering(all("button, input, select, summary, output").filter((item) => !item.closest("dialog, .cm-editor")));
  covering(all("dialog button, dialog input, dialog select"));
  covering(all(".block, .wire, .invitation"));
  return found;
})
