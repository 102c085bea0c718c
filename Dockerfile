# servogen as an image: docker build -t servogen . && docker run --rm -v "$PWD:/work" servogen check my-arm.toml
FROM python:3.11 AS build

# This image has gcc, which compiles the parts in C; what uses them needs no compiler.
WORKDIR /source
COPY pyproject.toml hatch_build.py README.md LICENSE ./
COPY servogen servogen
COPY templates templates
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.11-slim

# What the tested versions need comes from wheels: no compiler, no git.
COPY constraints.txt /opt/servogen/
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir -c /opt/servogen/constraints.txt "$(echo /wheels/servogen-*.whl)[plot,symbolic,testing]"

# The files are those of the folder mounted at /work; -u "$(id -u)" makes them yours.
WORKDIR /work
ENTRYPOINT ["servogen"]
CMD ["--help"]
