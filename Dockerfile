# The image runs with a GPU (NVIDIA through its container toolkit, AMD and Intel through /dev/dri) and, by Mesa's software
# driver, without one. It needs no root, and nothing writable but /tmp.
FROM rust:1-bookworm AS build
WORKDIR /tyndall
COPY . .
RUN cargo build --release --locked

FROM debian:bookworm-slim
# libegl1, libx11-6 and libxext6 are what NVIDIA's Vulkan driver looks for beside itself.
RUN apt-get update \
    && apt-get install -y --no-install-recommends libvulkan1 mesa-vulkan-drivers libegl1 libx11-6 libxext6 \
    && apt-get clean && rm -rf /var/lib/apt/lists/* /var/cache/apt/*.bin \
    && useradd --uid 10001 --no-create-home --home-dir /tmp tyndall \
    && mkdir /data
# Where the container toolkit brings NVIDIA's libraries but no description of them, as on many headless hosts, the Vulkan
# loader would not find them. A description whose library is absent is passed over.
RUN mkdir -p /etc/vulkan/icd.d \
    && echo '{"file_format_version": "1.0.0", "ICD": {"library_path": "libEGL_nvidia.so.0", "api_version": "1.3.0"}}' \
        > /etc/vulkan/icd.d/nvidia_headless.json
COPY --from=build /tyndall/target/release/tyndall /usr/local/bin/tyndall
# graphics brings Vulkan. NODEVICE_SELECT: there is no desktop to ask which GPU it prefers.
ENV NVIDIA_VISIBLE_DEVICES=all \
    NVIDIA_DRIVER_CAPABILITIES=graphics,compute,utility \
    NODEVICE_SELECT=1 \
    HOME=/tmp \
    XDG_CACHE_HOME=/tmp/.cache \
    MESA_SHADER_CACHE_DIR=/tmp/.cache
USER tyndall
EXPOSE 8080
HEALTHCHECK --interval=10s --timeout=5s --start-period=30s CMD ["tyndall", "healthcheck"]
ENTRYPOINT ["tyndall"]
CMD ["serve", "--listen", "0.0.0.0:8080", "--data", "/data"]
