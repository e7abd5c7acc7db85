# syntax=docker/dockerfile:1
# Build: docker build -t palpate .
# Token: docker run --rm -v palpate:/data palpate token create --name me --scope operate
# Run:   docker run -p 127.0.0.1:7257:7257 -v palpate:/data palpate

FROM node:20-bookworm-slim AS node

FROM rust:1.95-slim-bookworm AS build
# For the dashboard, which is built with the rest.
COPY --from=node /usr/local/bin/node /usr/local/bin/node
COPY --from=node /usr/local/lib/node_modules /usr/local/lib/node_modules
RUN ln -s ../lib/node_modules/npm/bin/npm-cli.js /usr/local/bin/npm
# For what makes the Debian package, which is what is installed below.
RUN apt-get update && apt-get install -y --no-install-recommends python3-venv xz-utils && rm -rf /var/lib/apt/lists/* \
    && python3 -m venv /opt/tools && /opt/tools/bin/pip install 'maturin>=1.12,<2' \
    && cargo install --debug --locked --no-default-features --root /opt/tools cargo-deb@3.8.0
ENV PATH=/opt/tools/bin:$PATH
WORKDIR /src
COPY Cargo.toml Cargo.lock CHANGELOG.md LICENSE ./
COPY .cargo .cargo
COPY migrations migrations
COPY proto proto
COPY core core
COPY contrib contrib
COPY packaging packaging
COPY clients clients
COPY tests tests
COPY server server
# The caches keep downloads and compiled dependencies between builds; what is shipped is copied out of them.
RUN --mount=type=cache,target=/usr/local/cargo/registry \
    --mount=type=cache,target=/src/target \
    packaging/build /packages

FROM debian:bookworm-slim
# The user of the package, with a number that volumes can rely on.
RUN --mount=type=bind,from=build,source=/packages,target=/packages \
    apt-get update && apt-get install -y --no-install-recommends adduser \
    && adduser --system --group --uid 10001 --home /var/lib/palpate --no-create-home palpate \
    && apt-get install -y --no-install-recommends /packages/palpate_*.deb \
    && rm -rf /var/lib/apt/lists/* \
    && install --directory --owner palpate --group palpate /data
USER palpate
WORKDIR /data
VOLUME /data
# Inside a container the loopback cannot be published, so all of its addresses are listened on, and callers are asked for
# tokens. Publish it on 127.0.0.1 only, as above, or with PALPATE_TLS_CERT and PALPATE_TLS_KEY: tokens come in the clear
# otherwise. With TLS the health check below has to be another one, such as curl --insecure https://127.0.0.1:7257/readyz.
ENV PALPATE_LISTEN=0.0.0.0:7257 PALPATE_DATABASE=/data/palpate.db
EXPOSE 7257
HEALTHCHECK --interval=10s --timeout=3s --start-period=5s \
    CMD ["bash", "-c", "exec 3<>/dev/tcp/127.0.0.1/7257 && printf 'GET /readyz HTTP/1.0\\r\\n\\r\\n' >&3 && head -n 1 <&3 | grep -q ' 200 '"]
ENTRYPOINT ["palpate"]
CMD ["serve"]
