// Contact and penetration over the clip, drawn under the scrubber.

/** Two areas in an SVG of 1000 x 40 units: vertices in contact above, depth of penetration below. */
export function drawGraph(svg, marks, deepestMm, mostContacts) {
  const frames = marks.contacts.length;
  const x = (frame) => (1000 * (frame + 0.5)) / frames;
  const area = (values, most, base, reach) => {
    const points = Array.from(values, (value, frame) => `${x(frame).toFixed(1)},${(base + (reach * value) / most).toFixed(2)}`);
    return `M0,${base} L${points.join(" L")} L1000,${base} Z`;
  };
  svg.querySelector(".graph-contact").setAttribute("d", area(marks.contacts, Math.max(1, mostContacts), 20, -18));
  svg.querySelector(".graph-penetration").setAttribute("d", area(marks.depths, Math.max(1, deepestMm), 20, 18));
}
