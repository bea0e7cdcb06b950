for (const choice of document.querySelectorAll("[data-choice]")) {
  const select = choice.querySelector("select");
  const show = () => {
    for (const one of choice.querySelectorAll("[data-of]")) one.hidden = one.dataset.of !== select.value;
  };
  select.addEventListener("change", show);
  show();
}
