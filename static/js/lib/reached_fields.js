/** The form of a robot: after the choice of a profile with the other ROS, ask the server for the fields of that ROS. */

const select = document.querySelector("select[data-ros2]");
if (select instanceof HTMLSelectElement && select.form) {
  const form = select.form;
  const second = new Set((select.dataset.ros2 ?? "").split(" "));
  const shown = form.elements.namedItem("domain_id") !== null;
  select.addEventListener("change", () => {
    if (second.has(select.value) === shown) return;
    const asks = document.createElement("input");
    Object.assign(asks, { type: "hidden", name: "_reached", value: "1" });
    form.append(asks);
    form.submit();
  });
}
